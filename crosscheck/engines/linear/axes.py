"""From derivatives in inboard axes to those in outboard ones, in which all engines give them.

Some codes count velocities x of ball joints or of free flight in inboard axes: x = R y, where R turns outboard to
inboard axes and y are the components in outboard axes. Displacements are x = R y too. With w the angular velocity in
outboard axes,

    y' = R'x' - w x y

and a rotation by xi, which keeps y, changes x by R (xi x y), and R'x' by (R'x') x xi.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from crosscheck.engines.conventions import cross_matrix
from crosscheck.engines.linear.matrices import quaternion_transport
from flexmb.typing import Real


class OutboardAxes:
    """The change of axes at one state of n speeds, block by block; other speeds are counted alike in both.

    `u` and `udot` (n,) are those in outboard axes, once `turned` was called for every block.
    """

    def __init__(self, speeds: Real, accelerations: Real) -> None:
        n = len(speeds)
        self.u, self.udot = speeds.copy(), accelerations.copy()
        self._axes, self._kept = np.eye(n), np.zeros((n, n))
        self._of_axes, self._of_speeds = np.zeros((n, n)), np.zeros((n, n))

    def turned(self, R: Real, block: slice, rotation: slice, w: Real) -> None:
        """The three speeds of a block are counted in inboard axes.

        `rotation` is the place of the rotations of the same freedom, `w` (3,) its angular velocity in outboard axes.
        """
        y, a = R.T @ self.u[block], R.T @ self.udot[block]
        self.u[block], self.udot[block] = y, a - np.cross(w, y)
        self._axes[block, block] = R
        self._kept[block, rotation] = -R @ cross_matrix(y)
        self._of_axes[block, rotation] = cross_matrix(a)
        self._of_speeds[block, rotation] += cross_matrix(y)
        self._of_speeds[block, block] -= cross_matrix(w)

    def by_displacement(self, by_displacement: Real, by_speed: Real) -> Real:
        """The derivative in outboard axes of both in inboard ones."""
        return self._axes.T @ (by_displacement @ self._axes + by_speed @ self._kept) + self._of_axes

    def by_speed(self, by_speed: Real) -> Real:
        return self._axes.T @ by_speed @ self._axes + self._of_speeds

    def by_force(self, by_force: Real) -> Real:
        return self._axes.T @ by_force @ self._axes

    @property
    def kept(self) -> float:
        """How strongly errors by speeds enter those by displacements."""
        return float(np.linalg.norm(self._kept))


def swapped_transport(u: Real, balls: Sequence[int], flying: Sequence[int]) -> Real:
    """The transport of speeds [linear; angular] of free flights, which begin at `flying`; balls begin at `balls`."""
    order = np.arange(len(u))
    for j in flying:
        order[j : j + 6] = [*range(j + 3, j + 6), *range(j, j + 3)]
    return quaternion_transport(u[order], balls, flying)[np.ix_(order, order)]
