"""The Jacobian of `flexmb.closure.jacobian` by another route, dual numbers: eight columns in two evaluations.

Tests hold the recursion against it. If a change dy of y changes g'' by dg'' under constant loads, these change by df,

    Lambda^-1 df = -dg''.

Each direction is evaluated first under the loads at y, then under loads that change by df.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure.dynamics import slope
from flexmb.closure.factor import solve
from flexmb.closure.tables import ClosureConstants
from flexmb.closure.tangent import ClosureTangentWorkspace, closure_tangent_workspace, evaluate
from flexmb.entry.tangent import TangentWorkspace, tangent_workspace
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import rate, seeded
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES
from flexmb.tables.arrays import Constants
from flexmb.tables.status import OK
from flexmb.typing import Real


@bundle
class ChainTangent:
    """Workspace of a Jacobian, in addition to the chain."""

    w: TangentWorkspace
    cw: ClosureTangentWorkspace
    load: Real  # (G,) of the rows at y
    slope: Real  # (nq+nu+1,) dy/dt there


def chain_tangent(c: Constants, cc: ClosureConstants, nq: int, nu: int) -> ChainTangent:
    """Make the workspace of `jacobian`; one per thread."""
    return ChainTangent(
        w=tangent_workspace(c, nq, nu), cw=closure_tangent_workspace(cc), load=np.zeros(len(cc.row)),
        slope=np.zeros(nq + nu + 1),
    )  # fmt: skip


@kernel
def jacobian(t, y, J, s, x):
    """J (n,n) = d(dy/dt)/dy at y = [q, u, work] (n,), row by row as `rhs` orders them; returns a status code.

    It holds for the constraint rows that s has chosen. Columns and rows of prescribed coordinates and speeds vanish.
    """
    n, columns, w, cw = y.shape[0], x.w.column.shape[0], x.w, x.cw
    status = slope(t, y, x.slope, s)
    w.time[0] = t
    for i in range(n):
        w.state[i] = y[i]
        for j in range(n):
            J[i, j] = 0.0
    for r in range(x.load.shape[0]):
        x.load[r] = s.cw.row[r].load
    for first in range(0, columns, LANES):
        count = min(LANES, columns - first)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = seeded(w.state[j], lane)
        for r in range(x.load.shape[0]):
            cw.row[r].load = x.load[r]
        if status == OK:
            status = evaluate(s.c, w, s.cc, cw)
        if status == OK:
            for lane in range(count):
                hold_rows(s, cw, lane)
            status = evaluate(s.c, w, s.cc, cw)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = y[j]
            for i in range(n):
                J[i, j] = rate(w.slope[i], lane)
    return status


@helper
def hold_rows(s, cw, lane):
    """Set the change of the loads along each direction that keeps the row accelerations at their values at y."""
    for g in range(s.cc.group.shape[0]):
        first = s.cc.group[g].row_start
        for place in range(first, first + s.cw.rank[g]):
            r = s.cw.chosen[place]
            damped = s.cw.gain[0] * rate(cw.row[r].rate, lane) + s.cw.gain[1] * rate(cw.row[r].value, lane)
            s.cw.scratch[place] = -(rate(cw.row[r].acceleration, lane) + damped)
    solve(s.cc, s.cw)
    for r in range(s.cw.row.shape[0]):
        load = cw.row[r].load
        cw.row[r].load = load + s.cw.row[r].load * (seeded(load, lane) - load)
