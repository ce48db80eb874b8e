"""A beam from its sections, by polynomials for its curvature: modes and mass integrals of its own.

Only the definition of the modes is that of flexmb: the span of the lowest clamped modes of bending and, with `static`,
of the deflections under a force and a moment at the tip. They are those of the continuum, where flexmb takes them from
finite elements. No output depends on the basis within that span.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss, legint, legval

from flexmb.scene.schema import BeamBody
from flexmb.typing import Real

POLYNOMIALS = 24
"""Of Legendre, for the curvature of a plane; the first ten modes of a uniform beam are then known to 1e-11."""
GAUSS = POLYNOMIALS + 4
"""Points along the beam: exact for products of two deflections and a linear section."""


class _Direction(NamedTuple):
    """A plane of bending: its deflections, their slope as a rotation, and the keys of its section."""

    family: str
    along: int
    about: int
    sign: float
    stiffness: str
    rotary: str


_DIRECTIONS = (
    _Direction("bending_y", 1, 2, 1.0, "EIz_Nm2", "rotary_z_kg_m"),
    _Direction("bending_z", 2, 1, -1.0, "EIy_Nm2", "rotary_y_kg_m"),
)


class AxisDeflections(NamedTuple):
    """Translation and rotation (n, 3, m) of places on the axis."""

    translation: Real
    rotation: Real


class _Plane(NamedTuple):
    """Modes of a plane: coefficients (POLYNOMIALS, k) of their curvature, stiffness (k,) for unit modal mass."""

    direction: _Direction
    columns: Real
    stiffness: Real


class BendingBeam:
    """A beam that bends, clamped at its root; `stiffness` (m, m) for unit modal masses, none at level "rigid"."""

    def __init__(self, body: BeamBody) -> None:
        self._length = body.length_m
        self._stations = sorted(body.stations, key=lambda station: station.x_m)
        xi, weight = leggauss(GAUSS)
        self._x, self._weight = 0.5 * self._length * (1.0 + xi), 0.5 * self._length * weight
        self._planes = [] if body.level == "rigid" else self._bending(body)
        self.stiffness = np.diag(np.concatenate([np.zeros(0), *(plane.stiffness for plane in self._planes)]))

    def moments(self) -> Real:
        """Second moments as in `kane.moments`: a section's mass, and its inertia about y and z as mass in its plane.

        A mass at (y, z) of a section is shifted along the axis by theta_y z - theta_z y.
        """
        at, none = self.deflections(self._x), np.zeros((len(self._x), 3))
        axis = none.copy()
        axis[:, 0] = self._x
        total = self._moment(1.0, axis, at.translation, "mass_per_length_kg_m")
        for way in _DIRECTIONS:
            place, shift = none.copy(), np.zeros_like(at.translation)
            place[:, way.along] = 1.0
            shift[:, 0] = -way.sign * at.rotation[:, way.about]
            total += self._moment(0.0, place, shift, way.rotary)
        return total

    def _moment(self, one: float, position: Real, shapes: Real, key: str) -> Real:
        """int y y' dx of y = [one, position, shapes], times the property `key` of the sections."""
        N = np.concatenate([position[:, :, None], shapes], axis=2).reshape(len(self._x), -1)
        return self._integral(np.column_stack([np.full(len(self._x), one), N]), key)

    def deflections(self, x: Real) -> AxisDeflections:
        """At places x (n,) m along the axis."""
        translation, rotation = np.zeros((2, len(x), 3, len(self.stiffness)))
        first = 0
        for way, columns, _ in self._planes:
            own = slice(first, first := first + columns.shape[1])
            translation[:, way.along, own] = self._integrated(x, 2) @ columns
            rotation[:, way.about, own] = way.sign * self._integrated(x, 1) @ columns
        return AxisDeflections(translation, rotation)

    def _integrated(self, x: Real, times: int) -> Real:
        """(n, POLYNOMIALS): curvatures, slopes or deflections of the polynomials, which vanish at the root."""
        unit = legint(np.eye(POLYNOMIALS), times, lbnd=-1.0, scl=0.5 * self._length)
        return np.asarray(legval(2.0 * x / self._length - 1.0, unit).T)

    def _integral(self, rows: Real, key: str) -> Real:
        """int rows' (property) rows dx of rows (GAUSS, k) at the Gauss points."""
        values = [getattr(station, key) for station in self._stations]
        weight = self._weight * np.interp(self._x, [station.x_m for station in self._stations], values)
        return np.asarray(rows.T @ (weight[:, None] * rows))

    def _bending(self, body: BeamBody) -> list[_Plane]:
        from scipy.linalg import eigh

        curvature, slope, deflection = (self._integrated(self._x, times) for times in range(3))
        tip = np.vstack([self._integrated(np.array([self._length]), times) for times in (1, 2)])
        found = []
        for way in _DIRECTIONS:
            if way.family not in (body.modes.families or ()):
                continue
            K = self._integral(curvature, way.stiffness)
            M = self._integral(deflection, "mass_per_length_kg_m") + self._integral(slope, way.rotary)
            # The lowest modes are the largest eigenvalues of this form, which are found with all digits.
            compliance, vectors = eigh(M, K)
            found.append((way, K, M, compliance[::-1], vectors[:, ::-1]))
        # Frequencies that agree to nine digits are those of one mode in two planes: the first plane comes first.
        ranked = sorted((-float(f"{c:.8e}"), n, k) for n, plane in enumerate(found) for k, c in enumerate(plane[3]))
        planes = []
        for n, (way, K, M, _, vectors) in enumerate(found):
            basis = vectors[:, [k for _, plane, k in ranked[: body.modes.count] if plane == n]]
            if body.modes.static:
                basis = np.column_stack([basis, np.linalg.solve(K, tip.T)])
            basis = basis / np.sqrt(np.einsum("im,ij,jm->m", basis, K, basis))
            compliance, mix = eigh(basis.T @ M @ basis, basis.T @ K @ basis)
            planes.append(_Plane(way, basis @ mix / np.sqrt(compliance), 1.0 / compliance))
        return planes
