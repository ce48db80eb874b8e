"""Derivatives of a closed chain at given constraint loads, exact to round-off, along seven directions at once.

The row loads f are constant, while their directions turn with the bodies: the tree's accelerations under J(q)'f are
differentiated, and the rates and accelerations of the rows. The change of the loads that keeps the row accelerations
zero then follows by linear algebra (`flexmb.linear.closed_variations`) or by another evaluation (`evaluate_held`).

As in `flexmb.entry.tangent`, the kernels are compiled once more for dual numbers. They do not need the pivots of the
closures.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure.couplings import evaluate_coupling, is_coupling
from flexmb.closure.factor import solve
from flexmb.closure.forces import DELICATE_CHANGES, is_delicate
from flexmb.closure.rows import evaluate_closure, load_on_b
from flexmb.closure.tables import CLOSURE_STATE, COUPLINGS, ON_GROUND, ROW_STATE, ClosureConstants
from flexmb.jain.balance import power
from flexmb.jain.forces import add_port_force
from flexmb.jain.kinematics import pose_sweep
from flexmb.jain.loads import drive_loads
from flexmb.jain.sweeps import bodies, inward, outward
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL, RATES, rate, seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel, sweep
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
    """Make the workspace of `evaluate`; one per thread."""
    return ClosureTangentWorkspace(
        closure=as_duals(np.zeros(len(cc.closure), CLOSURE_STATE)), row=as_duals(np.zeros(len(cc.row), ROW_STATE))
    )


@kernel
def change_by_time(t, y, load, out, c, w, cc, cw):
    """out (n+2G,): changes with time of dy/dt, the rows' rates and their accelerations, at y (n,) = [q, u, work] and
    loads (G,); returns a status code."""
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


@sweep
def evaluate_held(s, c, w, cc, cw):
    """As `evaluate`, under the row loads of the chain s of floats at the values of w.state, whose factors it has.

    If along a direction the accelerations of the rows change by dg'' under constant loads, the loads change by df,

        Lambda^-1 df = -dg'',

    for rows without accelerations or, stabilised, with decaying gaps. Each direction is evaluated under the loads as
    they are, then under those that change; where bodies are light (`is_delicate`), once more for what rounding left.
    """
    for r in range(cc.row.shape[0]):
        cw.row[r].load = s.cw.row[r].load
    status, left = evaluate(c, w, cc, cw), 2 if is_delicate(s.cc, s.cw, DELICATE_CHANGES) else 1
    while status == OK and left > 0:
        for lane in range(RATES):
            _hold_rows(s, cw, lane)
        status = evaluate(c, w, cc, cw)
        left -= 1
    return status


@sweep
def _hold_rows(s, cw, lane):
    """Change the loads along a direction so that the accelerations of the rows, evaluated before, change no more."""
    for g in range(s.cc.group.shape[0]):
        first = s.cc.group[g].row_start
        for place in range(first, first + s.cw.rank[g]):
            r = s.cw.chosen[place]
            damped = s.cw.gain[0] * rate(cw.row[r].rate, lane) + s.cw.gain[1] * rate(cw.row[r].value, lane)
            s.cw.scratch[place] = -(rate(cw.row[r].acceleration, lane) + damped)
    solve(s.cc, s.cw)
    for r in range(s.cw.row.shape[0]):
        load = cw.row[r].load
        cw.row[r].load = load + s.cw.solution[r] * seeded(load - load, lane)


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
