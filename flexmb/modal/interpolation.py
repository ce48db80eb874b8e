"""Shape functions of the beam element: nodal functions plus hierarchic functions that vanish at both ends.

Every family of motion (axial, torsion, one bending plane) is a one-dimensional field along the beam. The functions
added inside an element raise the polynomial degree without new nodes: frequencies converge with the element length h as
h^8 (nodal functions alone: h^4 in bending, h^2 in axial motion and torsion).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from flexmb.typing import Real

INTERNAL_LINE = 3
"""Internal functions per element of a line field: degree 4."""
INTERNAL_BENDING = 2
"""Internal functions per element and bending plane: deflection of degree 5."""
SHEAR_DEFLECTIONS = 4
"""Internal deflections without rotation per element and bending plane of a Timoshenko beam."""


@dataclass(frozen=True)
class LineValues:
    """Rows of a line field at n positions: value (n, d) and its derivative along x (n, d)."""

    value: Real
    slope: Real


@dataclass(frozen=True)
class BendingValues:
    """Rows of a bending plane at n positions, each (n, d).

    deflection v; rotation theta (equal to v' without shear); curvature theta'; shear strain gamma = v' - theta.
    """

    deflection: Real
    rotation: Real
    curvature: Real
    shear: Real


def integrated_legendre(xi: Real, count: int) -> tuple[Real, Real]:
    """g_k(xi) = integral_0^xi P_k(2 t - 1) dt for k = 1..count, zero at 0 and 1, and dg_k/dxi; each (n, count)."""
    s = 2.0 * xi - 1.0
    p = legendre.legvander(s, count + 1)
    k = np.arange(1, count + 1)  # (2 k + 1) P_k = P'_(k+1) - P'_(k-1), and ds = 2 dxi
    return (p[:, 2:] - p[:, :-2]) / (2.0 * (2 * k + 1)), p[:, 1:-1]


def line_shapes(xi: Real, h: Real) -> LineValues:
    """Local functions of a line element, columns [value at end 0, value at end 1, internal ...]."""
    g, dg = integrated_legendre(xi, INTERNAL_LINE)
    value = np.column_stack([1.0 - xi, xi, g])
    slope = np.column_stack([-np.ones_like(xi), np.ones_like(xi), dg]) / h[:, None]
    return LineValues(value, slope)


def bending_shapes(xi: Real, h: Real, shear: bool) -> BendingValues:
    """Local functions of a bending element, columns [v0, theta0, v1, theta1, internal ...].

    Without shear: the cubic Hermite functions and two internal deflections, all with theta = v'; they span all v of
    degree 5. With shear: in addition deflections without rotation and one rotation without deflection; together they
    span all v of degree 5 and, independently, all theta of degree 4. This space contains the static solutions of a
    uniform Timoshenko element (the interdependent interpolation, Friedman and Kosmatka, Computers & Structures 47
    (1993) 473) and the motions without shear. The element is therefore exact for end loads and free of shear locking.
    """
    x2, x3, x4 = xi**2, xi**3, xi**4
    one = np.ones_like(xi)
    v = np.column_stack([
        1 - 3 * x2 + 2 * x3,
        h * (xi - 2 * x2 + x3),
        3 * x2 - 2 * x3,
        h * (x3 - x2),
        h * (x2 - 2 * x3 + x4),
        h * (x2 - 4 * x3 + 5 * x4 - 2 * xi**5),
    ])  # fmt: skip
    theta = np.column_stack([
        6 * (x2 - xi) / h,
        1 - 4 * xi + 3 * x2,
        6 * (xi - x2) / h,
        3 * x2 - 2 * xi,
        2 * xi - 6 * x2 + 4 * x3,
        2 * xi - 12 * x2 + 20 * x3 - 10 * x4,
    ])  # fmt: skip
    curvature = np.column_stack([
        6 * (2 * xi - 1) / h,
        6 * xi - 4,
        6 * (1 - 2 * xi) / h,
        6 * xi - 2,
        2 - 12 * xi + 12 * x2,
        2 - 24 * xi + 60 * x2 - 40 * x3,
    ]) / h[:, None]  # fmt: skip
    if not shear:
        return BendingValues(v, theta, curvature, np.zeros_like(v))
    g, dg = integrated_legendre(xi, SHEAR_DEFLECTIONS)
    still, turn = np.zeros_like(g), (xi - x2)[:, None]
    return BendingValues(
        np.hstack([v, h[:, None] * g, 0 * turn]),
        np.hstack([theta, still, turn]),
        np.hstack([curvature, still, ((one - 2 * xi) / h)[:, None]]),
        np.hstack([np.zeros_like(v), dg, -turn]),
    )


@dataclass(frozen=True)
class ElementMesh:
    """Equal elements between x = 0 and the beam's length (m)."""

    nodes: Real

    @property
    def elements(self) -> int:
        return len(self.nodes) - 1

    def locate(self, x: Real) -> tuple[NDArray[np.intp], Real, Real]:
        """Element index, local coordinate in [0, 1] and element length at the positions x (n,)."""
        element = np.clip(np.searchsorted(self.nodes, x, side="right") - 1, 0, self.elements - 1)
        h = self.nodes[element + 1] - self.nodes[element]
        return element, (x - self.nodes[element]) / h, h


@dataclass(frozen=True)
class LineField:
    """Axial displacement or twist along the mesh. Coordinates: nodal values, then internal ones element by element."""

    mesh: ElementMesh

    @property
    def size(self) -> int:
        return self.mesh.elements + 1 + INTERNAL_LINE * self.mesh.elements

    @property
    def clamped_coordinates(self) -> tuple[int, ...]:
        """Coordinates that a clamp at x = 0 fixes."""
        return (0,)

    def at(self, x: Real) -> LineValues:
        """Rows over all coordinates, (n, size); read-only, since they are kept."""
        found: LineValues = _kept(LineField, self.mesh.nodes.tobytes(), np.asarray(x, float).tobytes())
        return found

    def rows(self, x: Real) -> LineValues:
        """The same, evaluated anew."""
        element, xi, h = self.mesh.locate(x)
        local = line_shapes(xi, h)
        internal = self.mesh.elements + 1 + INTERNAL_LINE * element
        columns = np.stack([element, element + 1, *(internal + k for k in range(INTERNAL_LINE))], axis=1)
        return LineValues(_spread(local.value, columns, self.size), _spread(local.slope, columns, self.size))

    def rigid(self) -> Real:
        """Coordinates (size, 1) of the rigid motion of this field: value 1 everywhere."""
        motion = np.zeros((self.size, 1))
        motion[: self.mesh.elements + 1, 0] = 1.0
        return motion


@dataclass(frozen=True)
class BendingField:
    """One bending plane. Coordinates: (v, theta) node by node, then internal ones element by element.

    `shear`: Timoshenko's kinematics, otherwise Euler-Bernoulli's.
    """

    mesh: ElementMesh
    shear: bool

    @property
    def _internal(self) -> int:
        return INTERNAL_BENDING + (SHEAR_DEFLECTIONS + 1 if self.shear else 0)

    @property
    def size(self) -> int:
        return 2 * (self.mesh.elements + 1) + self._internal * self.mesh.elements

    @property
    def clamped_coordinates(self) -> tuple[int, ...]:
        """Coordinates that a clamp at x = 0 fixes."""
        return (0, 1)

    def at(self, x: Real) -> BendingValues:
        """Rows over all coordinates, (n, size); read-only, since they are kept."""
        found: BendingValues = _kept(
            BendingField, self.mesh.nodes.tobytes(), np.asarray(x, float).tobytes(), self.shear
        )
        return found

    def rows(self, x: Real) -> BendingValues:
        """The same, evaluated anew."""
        element, xi, h = self.mesh.locate(x)
        local = bending_shapes(xi, h, self.shear)
        internal = 2 * (self.mesh.elements + 1) + self._internal * element
        nodal = [2 * element + k for k in range(4)]
        columns = np.stack([*nodal, *(internal + k for k in range(self._internal))], axis=1)
        return BendingValues(
            _spread(local.deflection, columns, self.size),
            _spread(local.rotation, columns, self.size),
            _spread(local.curvature, columns, self.size),
            _spread(local.shear, columns, self.size),
        )

    def rigid(self) -> Real:
        """Coordinates (size, 2) of the rigid motions: unit translation, unit rotation about x = 0."""
        motion = np.zeros((self.size, 2))
        nodal = 2 * (self.mesh.elements + 1)
        motion[0:nodal:2, 0] = 1.0
        motion[0:nodal:2, 1] = self.mesh.nodes
        motion[1:nodal:2, 1] = 1.0
        return motion


@lru_cache(maxsize=32)
def _kept(kind: type[LineField | BendingField], nodes: bytes, x: bytes, *shear: bool) -> Any:
    """The rows of a field on a mesh of these nodes, at these positions: both planes have the same, and so has a beam of
    which numbers differ that do not move its mesh, such as those by which it is differentiated."""
    found = kind(ElementMesh(np.frombuffer(nodes)), *shear).rows(np.frombuffer(x))
    for each in vars(found).values():
        each.flags.writeable = False
    return found


def _spread(local: Real, columns: NDArray[np.intp], size: int) -> Real:
    """Scatter local values (n, k) to rows over all coordinates (n, size)."""
    rows = np.zeros((len(local), size))
    np.put_along_axis(rows, columns, local, axis=1)
    return rows
