"""How a free motion changes with the state: what trees and closed chains have in common; changes of the coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.jit.kernel import helper, kernel
from flexmb.motion.coordinates import configuration_rate, load_state
from flexmb.typing import Index, Real

MOST_SPEEDS = 6  # of a hinge


class ByAllDirections(NamedTuple):
    """Derivatives of m numbers: by displacements along the speeds (m,nu), speeds (m,nu), generalised forces along the
    speeds (m,nu), and time (m,)."""

    by_displacement: Real
    by_speed: Real
    by_force: Real
    by_time: Real

    @property
    def by_all(self) -> Real:
        """(m,3nu+1), in this order."""
        return np.column_stack(self)


class RowChanges(NamedTuple):
    """The loads (G,) of the rows of closures with their derivatives; trees have no rows.

    chosen (r,): the independent rows, which carry the loads; response (r,r): J M^-1 J' of these.
    """

    loads: Real
    of_loads: ByAllDirections
    chosen: Index
    response: Real

    @property
    def lever(self) -> Real:
        """P = M^-1 J' Lambda (nu,G), the accelerations that give the rows unit accelerations: M is symmetric, so that
        they are the loads by forces with the opposite sign."""
        return -self.of_loads.by_force.T

    @property
    def inertia(self) -> Real:
        """Lambda = (J M^-1 J')^-1 (G,G), the loads that give the chosen rows unit accelerations."""
        found = np.zeros((len(self.loads), len(self.loads)))
        found[np.ix_(self.chosen, self.chosen)] = np.linalg.inv(self.response)
        return found


class FreeVariation(NamedTuple):
    """The accelerations (nu,) of a free motion with their derivatives, and the loads of the rows of closures.

    motion (nq,nu): N = d(qdot)/du, the change of the coordinates by displacements along the speeds. Columns of
    prescribed coordinates and speeds vanish.
    """

    accelerations: Real
    of_accelerations: ByAllDirections
    motion: Real
    rows: RowChanges


@kernel
def coordinate_motion(t, y, N, c, w):
    """N (nq,nu) = d(qdot)/du at y = [q, u, work], into zeros; the columns of prescribed speeds vanish.

    One evaluation for the first speeds of all hinges, then one for the second ones ...: no hinge depends on another.
    """
    load_state(t, y, c, w)
    for j in range(N.shape[1]):
        w.u[j] = 0.0
    for n in range(MOST_SPEEDS):
        for k in range(c.body.shape[0]):
            _set_speed(c, w, k, n, 1.0)
        configuration_rate(c, w, w.rate)
        for k in range(c.body.shape[0]):
            if n < c.body[k].nv:
                first = c.body[k].q_index
                for i in range(first, first + c.body[k].nv + (1 if c.body[k].quaternion >= 0 else 0)):
                    N[i, c.body[k].u_index + n] = w.rate[i]
            _set_speed(c, w, k, n, 0.0)
    for k in range(c.body.shape[0]):
        for n in range(c.body[k].modes):
            N[c.body[k].eta_index + n, c.body[k].etad_index + n] = 1.0
    for i in range(c.wheel.shape[0]):
        if c.speed[c.wheel[i].u_index].prescribed < 0:
            N[c.wheel[i].q_index, c.wheel[i].u_index] = 1.0


@helper
def _set_speed(c, w, k, n, value):
    """Speed n of the hinge of body k, if it has so many and this one is free."""
    j = c.body[k].u_index + n
    if n < c.body[k].nv and c.speed[j].prescribed < 0:
        w.u[j] = value


def displacement_of(N: Real) -> Real:
    """(nu,nq): displacements along the speeds by changes of the coordinates, of which those of a quaternion's length
    are none. The columns of N are orthogonal."""
    square = np.sum(N * N, axis=0)
    return np.asarray((N / np.where(square > 0.0, square, 1.0)).T)
