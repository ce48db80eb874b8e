"""Rows times the Jacobian of a tree's equations, in O(N): what a gradient needs that is carried backwards in time.

    x = pull_workspace(system.constants, system.nq, system.nu)
    status = pull(t, y, row, moved, system.constants, x)
"""

from __future__ import annotations

from flexmb.entry.derivatives import (
    DerivativeWorkspace,
    by_coordinates,
    derivative_workspace,
    rates_of_quaternion,
)
from flexmb.jain.derivatives.applied import pull_applied
from flexmb.jain.derivatives.pull_constants import pull_constants
from flexmb.jain.derivatives.pull_tables import Pulled, pulled
from flexmb.jain.derivatives.pulled import pull as pull_dynamics
from flexmb.jain.sweeps import forward_dynamics
from flexmb.jit.bundle import bundle
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.motion.coordinates import load_state
from flexmb.tables.arrays import Constants
from flexmb.tables.features import MODES, PRESCRIBED, QUATERNIONS, WHEELS
from flexmb.tables.status import OK


@bundle
class PullWorkspace:
    """The arrays of an evaluation and of the row; one set per thread."""

    w: DerivativeWorkspace
    p: Pulled


def pull_workspace(c: Constants, nq: int, nu: int) -> PullWorkspace:
    """A workspace of the right sizes, with derivatives by constants that are zero."""
    return PullWorkspace(derivative_workspace(c, nq, nu), pulled(c, nq, nu))


@kernel
def pull(t, y, row, moved, c, x):
    """moved (n,) = J'row with the Jacobian J of dy/dt at y = [q, u, work], as `derivatives.jacobian` has it; a status.

    The last entry of `row`, of the power, must be zero. Derivatives by the constants in x.p are added to its tables.
    """
    w, d, p = x.w.sweeps, x.w.tables, x.p
    load_state(t, y, c, w)
    status = forward_dynamics(c, w)
    nq, nu = w.q.shape[0], w.u.shape[0]
    if status != OK:
        return status
    for j in range(nu):
        p.virtual.speed[j] = row[nq + j]
    pull_dynamics(c, w, d, p)
    pull_applied(c, w, d, p.virtual.speed, p.row)
    pull_constants(c, w, d, p)
    by_coordinates(c, x.w, p.row, moved, nq)
    for k in range(c.body.shape[0]):
        _add_rates(c, x, k, row, moved)
    if has(c, WHEELS):
        for i in range(c.wheel.shape[0]):
            moved[nq + c.wheel[i].u_index] += row[c.wheel[i].q_index]
    if has(c, PRESCRIBED):
        for j in range(nu):
            if c.speed[j].prescribed >= 0:
                moved[c.speed[j].coordinate] = moved[nq + j] = 0.0
    return OK


@helper
def _add_rates(c, x, k, row, moved):
    """What the rates of the coordinates of body k pull."""
    i, j, nq = c.body[k].q_index, c.body[k].u_index, x.w.sweeps.q.shape[0]
    if has(c, QUATERNIONS) and c.body[k].quaternion >= 0:
        J, nv = x.p.square, c.body[k].nv
        rates_of_quaternion(c, x.w, k, J, nq)
        for m in range(nv + 1):
            for n in range(nv + 1):
                moved[i + n] += row[i + m] * J[i + m, i + n]
            for n in range(nv):
                moved[nq + j + n] += row[i + m] * J[i + m, nq + j + n]
    else:
        for n in range(c.body[k].nv):
            moved[nq + j + n] += row[i + n]
    if has(c, MODES):
        for n in range(c.body[k].modes):
            moved[nq + c.body[k].etad_index + n] += row[c.body[k].eta_index + n]
