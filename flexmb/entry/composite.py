"""Entry points of the composite-body algorithm: mass matrix, accelerations, right-hand side."""

from __future__ import annotations

from flexmb.jain import composite
from flexmb.jain.balance import power
from flexmb.jain.places import Matrices
from flexmb.jit.bundle import bundle
from flexmb.jit.kernel import kernel
from flexmb.motion.coordinates import load_state, store_slope
from flexmb.tables.arrays import Workspace
from flexmb.tables.status import OK
from flexmb.typing import Index


@bundle
class CompositeWorkspace:
    """The arrays that an evaluation by composite bodies writes."""

    sweeps: Workspace
    matrices: Matrices

    @property
    def fault(self) -> Index:
        """(1,) body where an evaluation failed."""
        return self.sweeps.fault


@kernel
def mass_matrix(t, y, c, w, m, M):
    """M (nu,nu) at the configuration of y."""
    load_state(t, y, c, w)
    composite.mass_matrix(c, w, m)
    nu = M.shape[0]
    for a in range(nu):
        i = m.speed[a]
        for b in range(a, nu):
            j = m.speed[b]
            M[i, j] = m.M[a, b]
            M[j, i] = m.M[a, b]


@kernel
def accelerations(t, y, c, w, m):
    """udot to w.speed.acceleration, drive loads to w.speed.drive; returns a status code."""
    load_state(t, y, c, w)
    return composite.forward_dynamics(c, w, m)


@kernel
def rhs(t, y, dy, c, w):
    """dy/dt of y = [q, u, work] at time t; returns a status code. `work` integrates the non-conservative power."""
    load_state(t, y, c, w.sweeps)
    status = composite.forward_dynamics(c, w.sweeps, w.matrices)
    if status != OK:
        return status
    store_slope(c, w.sweeps, power(c, w.sweeps), dy)
    return OK
