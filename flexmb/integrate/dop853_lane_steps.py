"""One step of DOP853 for eight runs at once: stages, error norms, the first step, and the interpolant of a step."""

from __future__ import annotations

import math

from flexmb.integrate.control import copy
from flexmb.integrate.dop853_formulas import END, ERROR_EXPONENT, combine, error_norm, error_sums, interpolant
from flexmb.integrate.dop853_tableau import STAGES, STAGES_DENSE, A, C
from flexmb.integrate.lane_control import RUNNING, set_times
from flexmb.integrate.lane_problem import any_chosen, lane_derivative, mark_finite
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import LANES, select
from flexmb.tables.status import OK


@helper
def _stages(problem, s, entries, control, counts):
    """Stages 1 to 11 (stage 0 is given), then s.trial = y(t + h); returns a status code."""
    for stage in range(1, STAGES + 1):
        combine(s.y, s.h[0], A[stage], stage, s.k, s.trial)
        if stage == END:
            break
        set_times(entries, control, C[stage])
        status = lane_derivative(problem, s, stage, counts)
        if status != OK:
            return status
    return OK


@helper
def _judge(s, entries, control, accuracy):
    """The error norm of each lane, infinite if its state is not finite; marks the lanes whose error is acceptable."""
    mark_finite(s.trial, s.chosen)
    s.norm[0], s.norm[1] = error_sums(s.y, s.trial, s.k, accuracy)
    for lane in range(LANES):
        error = error_norm(control.length[lane], entries.norm[0, lane], entries.norm[1, lane], accuracy)
        finite = entries.chosen[0, lane] == 1.0
        control.error[lane] = error if finite else math.inf
        entries.chosen[0, lane] = 1.0 if control.status[lane] == RUNNING and finite and error < 1.0 else 0.0


@helper
def attempt(problem, s, entries, control, accuracy, counts):
    """One trial step of all lanes: s.y_new, projected, and its slope; marks the lanes that accept it."""
    status = _stages(problem, s, entries, control, counts)
    if status != OK:
        return status
    _judge(s, entries, control, accuracy)
    if not any_chosen(entries):
        return OK
    for lane in range(LANES):
        entries.time[0, lane] = control.end[lane]
    problem.project(problem.stages, problem.manifold)
    copy(s.trial, s.y_new)
    for lane in range(LANES):
        entries.time[0, lane] = min(control.end[lane], control.last[lane])
    status = lane_derivative(problem, s, END, counts)
    if status != OK:
        return status
    accepted = s.chosen[0]
    mark_finite(s.k[END], s.chosen)
    s.chosen[0] = select(accepted > 0.0, s.chosen[0], 0.0)
    for lane in range(LANES):
        if control.error[lane] < 1.0 and entries.chosen[0, lane] == 0.0:
            control.error[lane] = math.inf
    return OK


@helper
def first_step(problem, s, entries, control, accuracy, counts):
    """First step sizes: Hairer, Norsett, Wanner I, II.4, as `flexmb.integrate.control.initial_step`."""
    s.norm[0], s.norm[1] = _squares(s, s.y, accuracy), _squares(s, s.k[0], accuracy)
    for lane in range(LANES):
        d0, d1 = _norm(entries.norm[0, lane], accuracy), _norm(entries.norm[1, lane], accuracy)
        h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        control.length[lane] = min(h0, control.end[lane] - control.t[lane])
        control.error[lane] = d1
        entries.h[0, lane] = control.length[lane]
    for i in range(s.y.shape[0]):
        s.trial[i] = s.y[i] + s.h[0] * s.k[0, i]
    set_times(entries, control, 1.0)
    status = lane_derivative(problem, s, 1, counts)
    if status != OK:
        return status
    for i in range(s.y.shape[0]):
        s.k[2, i] = s.k[1, i] - s.k[0, i]
    mark_finite(s.k[1], s.chosen)
    s.norm[2] = _squares(s, s.k[2], accuracy)
    for lane in range(LANES):
        h0, d1 = control.length[lane], control.error[lane]
        d2 = _norm(entries.norm[2, lane], accuracy) / h0
        h1 = max(1e-6, h0 * 1e-3) if d1 <= 1e-15 and d2 <= 1e-15 else (0.01 / max(d1, d2)) ** (1.0 / ERROR_EXPONENT)
        span = control.end[lane] - control.t[lane]
        control.h[lane] = min(100.0 * h0, h1, span) if entries.chosen[0, lane] == 1.0 else h0
    return OK


@helper
def _norm(total, accuracy):
    """Root mean square from a sum of squares."""
    return math.sqrt(total / accuracy.controlled) if accuracy.controlled > 0 else 0.0


@helper
def _squares(s, values, accuracy):
    """Sum of squares of values (n,) over atol + rtol |y|."""
    total = 0.0
    for i in range(accuracy.controlled):
        a = values[i] / (accuracy.atol + accuracy.rtol * abs(s.y[i]))
        total += a * a
    return total


@helper
def last_stages(problem, s, entries, control, counts):
    """Three more stages, then the coefficients s.f (7,n) of the interpolant from y to y_new. Returns a status code."""
    for stage in range(STAGES + 1, STAGES_DENSE):
        combine(s.y, s.h[0], A[stage], stage, s.k, s.trial)
        set_times(entries, control, C[stage])
        status = lane_derivative(problem, s, stage, counts)
        if status != OK:
            return status
    interpolant(s.y, s.y_new, s.h[0], s.k, s.f)
    return OK
