"""A free finite-element structure: stiffness, mass and nodes, checked by its rigid-body motions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexmb.scene.quaternions import cross_matrix
from flexmb.typing import Real

RIGID = 1e-6
"""Largest force of a rigid-body motion, relative to the sum of the magnitudes of its terms, that counts as rounding."""
DUST = 1e-12
"""Forces and masses below this share of the structure's largest are rounding: what programs write in place of zeros."""
ALIKE = 1e-6  # relative difference allowed between the masses in x, y and z, and the halves of a symmetric matrix
LARGEST = 1e60  # as in scenes: beyond all mechanical quantities, with finite sums and products
MOTIONS = ("translation x", "translation y", "translation z", "rotation x", "rotation y", "rotation z")


class SuperElementError(ValueError):
    """Finite-element data that is not a free structure: defect and remedy."""


@dataclass(frozen=True, eq=False)
class SuperElement:
    """K (N,N) N/m and M (N,N) kg of a free structure with n nodes, all in the same axes.

    ids (n,); position (n,3) m; place (n,6): the row of each node's displacement along x, y, z and rotation about them,
    -1 if it has none.
    """

    K: Real
    M: Real
    ids: NDArray[np.int64]
    position: Real
    place: NDArray[np.int64]

    def node(self, number: int) -> int:
        """The index of the node with this number; SuperElementError, which lists the numbers, if there is none."""
        rows = np.flatnonzero(self.ids == number)
        if len(rows) == 0:
            some = ", ".join(map(str, self.ids[:8])) + (", ..." if len(self.ids) > 8 else "")
            raise SuperElementError(f"there is no node {number}: the nodes are {some}")
        return int(rows[0])

    def lever(self) -> Real:
        """By row (N,), the length (m) that makes a displacement of it: 1 for translations, the reach for rotations.

        K and M, divided by the levers of rows and columns, have one unit.
        """
        arms = self.position - self.position.mean(axis=0)
        long = float(np.max(np.linalg.norm(arms, axis=1), initial=0.0)) or 1.0
        lever = np.ones(len(self.K))
        lever[self.place[:, 3:][self.place[:, 3:] >= 0]] = long
        return lever

    def rigid(self, about: Real) -> Real:
        """The six rigid-body motions (N,6) about a point (3,) m: translations, then small rotations."""
        arms = cross_matrix(about - self.position)  # w x r = -r~ w
        one, none = np.broadcast_to(np.eye(3), arms.shape), np.zeros_like(arms)
        motion = np.concatenate([np.concatenate([one, arms], axis=2), np.concatenate([none, one], axis=2)], axis=1)
        R = np.zeros((len(self.K), 6))
        R[self.place[self.place >= 0]] = motion[self.place >= 0]
        return R


def super_element(
    K: ArrayLike, M: ArrayLike, position: ArrayLike, ids: Sequence[int] | None = None, dofs: Sequence[str] | None = None
) -> SuperElement:
    """A structure from matrices (N,N) and nodes at `position` (n,3) m.

    `ids` are the numbers of the nodes, by default 1 to n. `dofs` lists the displacements (1, 2, 3) and rotations
    (4, 5, 6) of each node that have a row, in their order, by default all six: "123" for a node of a solid.

    Raises SuperElementError for matrices that are not symmetric, do not fit the nodes, or do not belong to a free
    structure, whose six rigid-body motions need no force and have the same mass in all directions.
    """
    position = np.asarray(position, dtype=float).reshape(-1, 3)
    if not np.all(np.abs(position) <= LARGEST):
        raise SuperElementError(f"a coordinate of a node is not finite or beyond {LARGEST:g}: give positions in m")
    numbers = np.arange(1, len(position) + 1) if ids is None else np.asarray(ids, dtype=np.int64)
    K, M = (_symmetric(name, matrix) for name, matrix in (("K", K), ("M", M)))
    place = _places(numbers, ["123456"] * len(position) if dofs is None else list(dofs))
    rows = int(np.count_nonzero(place >= 0))
    if not rows:
        raise SuperElementError("there is no node with a displacement: list nodes and displacements for the rows of K")
    if not len(K) == len(M) == rows:
        solid = "; a node of a solid has three: give its dofs as 123" if len(K) == len(M) == 3 * len(position) else ""
        raise SuperElementError(
            f"K has {len(K)} rows, M {len(M)}, and the nodes {rows} displacements: they must agree{solid}"
        )
    element = SuperElement(K, M, numbers, position, place)
    _check_stiffness(element)
    _check_mass(element)
    return element


def _symmetric(name: str, given: ArrayLike) -> Real:
    matrix = np.asarray(given, dtype=float)
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise SuperElementError(f"{name} is not a square matrix: it has the shape {matrix.shape}")
    if not np.all(np.abs(matrix) <= LARGEST):
        i, j = np.argwhere(~(np.abs(matrix) <= LARGEST))[0] + 1
        raise SuperElementError(
            f"{name}[{i},{j}] is {matrix[i - 1, j - 1]:g}: give finite numbers in SI units, of at most {LARGEST:g}"
        )
    gap = np.abs(matrix - matrix.T)
    if np.max(gap, initial=0.0) > ALIKE * np.max(np.abs(matrix), initial=0.0):
        i, j = np.unravel_index(int(np.argmax(gap)), gap.shape)
        raise SuperElementError(
            f"{name} is not symmetric: [{i + 1},{j + 1}] and [{j + 1},{i + 1}] differ: write both halves"
        )
    return 0.5 * (matrix + matrix.T)


def _places(ids: NDArray[np.int64], dofs: list[str]) -> NDArray[np.int64]:
    if len(set(ids.tolist())) != len(ids) or len(dofs) != len(ids):
        raise SuperElementError("a node number is repeated, or numbers, positions and dofs differ in length")
    place, row = np.full((len(ids), 6), -1, dtype=np.int64), 0
    for i, digits in enumerate(dofs):
        if not digits or any(digit not in "123456" for digit in digits) or len(set(digits)) != len(digits):
            raise SuperElementError(
                f'node {ids[i]} has the dofs "{digits}": write digits 1 to 6, such as 123 or 123456'
            )
        for digit in digits:
            place[i, int(digit) - 1] = row
            row += 1
    return place


def _check_stiffness(element: SuperElement) -> None:
    R, lever = element.rigid(element.position.mean(axis=0)), element.lever()
    units = np.outer(lever, np.repeat((1.0, np.max(lever)), 3))
    force, parts = np.abs(element.K @ R) / units, np.abs(element.K) @ np.abs(R) / units
    dust = DUST * np.max(parts, initial=0.0)
    share = np.max(np.where(force > dust, force, 0.0) / np.where(parts > 0.0, parts, 1.0), axis=0)
    worst = int(np.argmax(share))
    if not share[worst] <= RIGID:
        raise SuperElementError(
            f"K resists the rigid-body {MOTIONS[worst]} ({share[worst]:.1g} of its forces do not cancel): write K "
            "without supports, without springs to the ground, and check coordinates, axes and units of the nodes"
        )


def _check_mass(element: SuperElement) -> None:
    total = element.rigid(np.zeros(3))[:, :3]
    mass = total.T @ element.M @ total
    mean = float(np.trace(mass)) / 3.0
    if not mean > 0.0 or np.max(np.abs(mass - mean * np.eye(3))) > ALIKE * mean:
        found = ", ".join(f"{number:.6g}" for number in np.diag(mass))
        raise SuperElementError(
            f"the mass of M in x, y and z is {found} kg: a free structure has one mass; write M without supports and "
            "with mass at every displacement"
        )
