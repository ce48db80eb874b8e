"""The Jacobian of `flexmb.closure.jacobian` by another route, dual numbers: seven columns at once, along each direction
under loads that keep the rows' accelerations."""

from __future__ import annotations

import numpy as np

from flexmb.closure.dynamics import slope
from flexmb.closure.tables import ClosureConstants
from flexmb.closure.tangent import ClosureTangentWorkspace, closure_tangent_workspace, evaluate_held
from flexmb.entry.tangent import TangentWorkspace, tangent_workspace
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import RATES, rate, seeded
from flexmb.jit.kernel import kernel
from flexmb.tables.arrays import Constants
from flexmb.tables.status import OK
from flexmb.typing import Real


@bundle
class ChainTangent:
    """Workspace of a Jacobian, in addition to the chain."""

    w: TangentWorkspace
    cw: ClosureTangentWorkspace
    slope: Real  # (nq+nu+1,) dy/dt there


def chain_tangent(c: Constants, cc: ClosureConstants, nq: int, nu: int) -> ChainTangent:
    """Make the workspace of `jacobian`; one per thread."""
    return ChainTangent(
        w=tangent_workspace(c, nq, nu), cw=closure_tangent_workspace(cc), slope=np.zeros(nq + nu + 1)
    )  # fmt: skip


@kernel
def jacobian(t, y, J, s, x):
    """J (n,n) = d(dy/dt)/dy at y = [q, u, work] (n,), row by row as `rhs` orders them; returns a status code.

    It holds for the constraint rows that s has chosen. Columns and rows of prescribed coordinates and speeds vanish.
    """
    n, columns, w = y.shape[0], x.w.column.shape[0], x.w
    status = slope(t, y, x.slope, s)
    w.time[0] = t
    for i in range(n):
        w.state[i] = y[i]
        for j in range(n):
            J[i, j] = 0.0
    for first in range(0, columns, RATES):
        count = min(RATES, columns - first)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = seeded(w.state[j], lane)
        if status == OK:
            status = evaluate_held(s, s.c, w, s.cc, x.cw)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = y[j]
            for i in range(n):
                J[i, j] = rate(w.slope[i], lane)
    return status
