"""How a free motion changes with the state: what trees and closed chains have in common; changes of the coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.jit.kernel import kernel
from flexmb.motion.coordinates import configuration_rate, load_state
from flexmb.typing import Real


class StateDerivatives(NamedTuple):
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


class Variation(NamedTuple):
    """The accelerations (nu,) of a free motion and the loads (G,) of the rows of closures, with their derivatives.

    motion (nq,nu): N = d(qdot)/du, the change of the coordinates by displacements along the speeds. Columns of
    prescribed coordinates and speeds vanish. Trees have no rows. lever (nu,G): P = M^-1 J' Lambda, accelerations that
    give the rows unit accelerations; inertia (G,G): Lambda = (J M^-1 J')^-1, the loads for that; of the independent
    rows, zero for the others.
    """

    accelerations: Real
    of_accelerations: StateDerivatives
    motion: Real
    loads: Real
    of_loads: StateDerivatives
    lever: Real
    inertia: Real


@kernel
def coordinate_motion(t, y, N, c, w):
    """N (nq,nu) = d(qdot)/du at y = [q, u, work]; the columns of prescribed speeds vanish."""
    load_state(t, y, c, w)
    nq, nu = N.shape[0], N.shape[1]
    for j in range(nu):
        w.u[j] = 0.0
    for j in range(nu):
        w.u[j] = 0.0 if c.speed[j].prescribed >= 0 else 1.0
        configuration_rate(c, w, w.rate)
        w.u[j] = 0.0
        for i in range(nq):
            N[i, j] = w.rate[i]


def displacement_of(N: Real) -> Real:
    """(nu,nq): displacements along the speeds by changes of the coordinates, of which those of a quaternion's length
    are none. The columns of N are orthogonal."""
    square = np.sum(N * N, axis=0)
    return np.asarray((N / np.where(square > 0.0, square, 1.0)).T)
