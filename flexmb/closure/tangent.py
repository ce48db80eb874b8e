"""Derivatives of a closed chain at given constraint loads, exact to round-off: eight columns in one evaluation.

    w = tangent_workspace(c, nq, nu)
    cw = closure_tangent_workspace(cc)
    status = closed_jacobian(t, y, load, J, c, w, cc, cw)

The row loads f are constant, while their directions turn with the bodies: the tree's accelerations under J(q)'f are
differentiated, and the rates and accelerations of the rows. The change of the loads that keeps the row accelerations
zero then follows by linear algebra (`flexmb.linear.closed_variations`) or by another evaluation
(`flexmb.closure.jacobian`).

As in `flexmb.entry.tangent`, the kernels are compiled once more for dual numbers. They do not need the pivots of the
closures.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure.couplings import evaluate_coupling, is_coupling
from flexmb.closure.rows import evaluate_closure, load_on_b
from flexmb.closure.tables import CLOSURE_STATE, COUPLINGS, ON_GROUND, ROW_STATE, ClosureConstants
from flexmb.jain.balance import power
from flexmb.jain.forces import add_port_force
from flexmb.jain.kinematics import pose_sweep
from flexmb.jain.loads import drive_loads
from flexmb.jain.sweeps import bodies, inward, outward
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL, rate, seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.jit.lanes import LANES
from flexmb.jit.wide_arrays import as_duals
from flexmb.motion.coordinates import load_state, store_slope
from flexmb.spatial.spatial_vector import scale6, shift_force, times6, times6_t
from flexmb.spatial.vector import mat3, vec3
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK
from flexmb.typing import Record


@bundle
class ClosureTangentWorkspace:
    """Workspace of the rows, in dual numbers."""

    numbers = DUAL

    closure: Record  # (C,) CLOSURE_STATE
    row: Record  # (G,) ROW_STATE


def closure_tangent_workspace(cc: ClosureConstants) -> ClosureTangentWorkspace:
    """Make the workspace of `closed_jacobian`; one per thread."""
    return ClosureTangentWorkspace(
        closure=as_duals(np.zeros(len(cc.closure), CLOSURE_STATE)), row=as_duals(np.zeros(len(cc.row), ROW_STATE))
    )


@kernel
def closed_jacobian(t, y, load, J, c, w, cc, cw):
    """J (n+2G,n+1) = d[dy/dt; rows' rates; rows' accelerations]/d[y, t], at y (n,) = [q, u, work] and loads (G,).

    Rows are ordered as in `flexmb.entry.tangent.jacobian`; the values themselves are stored in w.slope and cw.row.
    Returns a status code. Columns of prescribed coordinates and speeds vanish.
    """
    n, rows, columns = y.shape[0], cc.row.shape[0], w.column.shape[0]
    w.time[0] = t
    for i in range(n):
        w.state[i] = y[i]
    for r in range(rows):
        cw.row[r].load = load[r]
    for i in range(J.shape[0]):
        for j in range(n + 1):
            J[i, j] = 0.0
    for first in range(0, columns, LANES):
        count = min(LANES, columns - first)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = seeded(w.state[j], lane)
        status = evaluate(c, w, cc, cw)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = y[j]
            _read_column(J, j, lane, w, cw)
        if status != OK:
            return status
    w.time[0] = seeded(w.time[0], 0)
    status = evaluate(c, w, cc, cw)
    _read_column(J, n, 0, w, cw)
    return status


@kernel
def change_by_time(t, y, load, out, c, w, cc, cw):
    """out (n+2G,): the last column of `closed_jacobian` alone; returns a status code."""
    n, rows = y.shape[0], cc.row.shape[0]
    w.time[0] = t
    w.time[0] = seeded(w.time[0], 0)
    for i in range(n):
        w.state[i] = y[i]
    for r in range(rows):
        cw.row[r].load = load[r]
    status = evaluate(c, w, cc, cw)
    for i in range(n):
        out[i] = rate(w.slope[i], 0)
    for r in range(rows):
        out[n + r] = rate(cw.row[r].rate, 0)
        out[n + rows + r] = rate(cw.row[r].acceleration, 0)
    return status


@helper
def _read_column(J, j, lane, w, cw):
    n, rows = w.slope.shape[0], cw.row.shape[0]
    for i in range(n):
        J[i, j] = rate(w.slope[i], lane)
    for r in range(rows):
        J[n + r, j] = rate(cw.row[r].rate, lane)
        J[n + rows + r, j] = rate(cw.row[r].acceleration, lane)


@sweep
def evaluate(c, w, cc, cw):
    """Slope of the tree under the row loads, and the resulting row accelerations; returns a status code."""
    load_state(w.time[0], w.state, c, w)
    status = bodies(c, w)
    if status != OK:
        return status
    pose_sweep(c, w)
    for i in range(cc.closure.shape[0]):
        _row_motion(c, w, cc, cw, i, False)
        _apply(c, w, cc, cw, i)
    if not inward(c, w):
        return NOT_POSITIVE_DEFINITE
    outward(c, w)
    for i in range(cc.closure.shape[0]):
        _row_motion(c, w, cc, cw, i, True)
    drive_loads(c, w)
    store_slope(c, w, power(c, w), w.slope)
    return OK


@helper
def _row_motion(c, w, cc, cw, i, accelerated):
    if has(cc, COUPLINGS) and is_coupling(cc, i):
        evaluate_coupling(c, w, cc, cw, i, accelerated)
    else:
        evaluate_closure(c, w, cc, cw, i, accelerated)


@helper
def _apply(c, w, cc, cw, i):
    """Add the loads of closure i to the body of B, and the opposite ones to that of A; of a coupling to its speeds."""
    if has(cc, COUPLINGS) and is_coupling(cc, i):
        for n in range(cc.closure[i].term_start, cc.closure[i].term_stop):
            w.speed[cc.term[n].speed].applied += cc.term[n].factor * cw.row[cc.closure[i].row_start].load
    else:
        F = load_on_b(cc, cw, i)
        _add_load(c, w, cc.side[i, 1], times6_t(mat3(cw.closure[i].rotation, 0), F))
        _add_load(c, w, cc.side[i, 0], scale6(-1.0, shift_force(F, vec3(cw.closure[i].position, 0))))


@helper
def _add_load(c, w, side, F):
    """Add a load about a port, in port axes, to its body and modes."""
    if side.body != ON_GROUND:
        on_body = times6(mat3(w.port[side.port].R, 0), F)
        add_port_force(c, w, w, side.body, side.port, scale6(-1.0, on_body))
