"""DOP853 for eight runs at once: `flexmb.integrate.dop853` in lanes, each with its own time, step and samples.

All lanes try a step together; each decides for itself whether it accepts, and how it goes on. A lane that has reached
its end, or whose run has failed, tries steps of no length until the others are ready.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import (
    ACCEPTED,
    CALM,
    REJECTED,
    SAMPLES,
    next_step,
    retreat,
    shorter,
    step_end,
    step_factor,
)
from flexmb.integrate.dop853 import _END, _ERROR_EXPONENT
from flexmb.integrate.dop853_tableau import E3, E5, STAGES, STAGES_DENSE, A, C, D
from flexmb.integrate.lane_problem import (
    any_chosen,
    lane_copy,
    lane_derivative,
    mark_finite,
    set_all,
    store_lane,
)
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES, select
from flexmb.tables.status import NONFINITE, OK, STEP_TOO_SMALL


class LaneControl(NamedTuple):
    """What each lane (LANES,) knows of its own run: time, proposed step, end and length of the step it tries (s), last
    time of a stage, error norms of this step and of the one accepted before, whether the last was rejected, segment,
    number of its segments, and its status, RUNNING until it ends.
    """

    t: np.ndarray
    h: np.ndarray
    end: np.ndarray
    length: np.ndarray
    last: np.ndarray
    error: np.ndarray
    error_before: np.ndarray
    rejected: np.ndarray
    segment: np.ndarray
    ends: np.ndarray
    status: np.ndarray


RUNNING = -1


def lane_control(ends: np.ndarray) -> LaneControl:
    """For runs with so many (LANES,) segments."""
    floats, integers = np.zeros((7, LANES)), np.zeros((2, LANES), np.int64)
    return LaneControl(*floats, *integers, ends, np.full(LANES, RUNNING))


@helper
def _combine(s, weights, count):
    """s.trial = y + h * sum over j < count of weights[j] k[j], past the many zeros of the weights."""
    n, h = s.y.shape[0], s.h[0]
    for i in range(n):
        s.trial[i] = weights[0] * s.k[0, i]
    for j in range(1, count):
        a = weights[j]
        if a != 0.0:
            for i in range(n):
                s.trial[i] += a * s.k[j, i]
    for i in range(n):
        s.trial[i] = s.y[i] + h * s.trial[i]


@helper
def _weighted_sum(weights, count, k, i):
    total = weights[0] * k[0, i]
    for j in range(1, count):
        total += weights[j] * k[j, i]
    return total


@helper
def _set_times(entries, control, fraction):
    """The time of each lane at this fraction of its step, not later than its last one."""
    for lane in range(LANES):
        time = control.t[lane] + fraction * control.length[lane]
        entries.time[0, lane] = min(time, control.last[lane])


@helper
def _stages(problem, s, entries, control, counts):
    """Stages 1 to 11 (stage 0 is given), then s.trial = y(t + h); returns a status code."""
    for stage in range(1, STAGES + 1):
        _combine(s, A[stage], stage)
        if stage == _END:
            break
        _set_times(entries, control, C[stage])
        status = lane_derivative(problem, s, stage, counts)
        if status != OK:
            return status
    return OK


@helper
def _error_sums(s, accuracy):
    """Sums of squares of the 5th and 3rd order error estimates over the tolerance, into s.norm[0] and s.norm[1]."""
    sum5, sum3 = 0.0, 0.0
    for i in range(accuracy.controlled):
        old, new = abs(s.y[i]), abs(s.trial[i])
        scale = accuracy.atol + accuracy.rtol * select(new > old, new, old)
        five = _weighted_sum(E5, E5.shape[0], s.k, i) / scale
        three = _weighted_sum(E3, E3.shape[0], s.k, i) / scale
        sum5 += five * five
        sum3 += three * three
    s.norm[0], s.norm[1] = sum5, sum3


@helper
def _judge(s, entries, control, accuracy):
    """The error norm of each lane, infinite where its state is not finite; marks those that may accept their steps."""
    mark_finite(s.trial, s.chosen)
    _error_sums(s, accuracy)
    for lane in range(LANES):
        sum5, sum3 = entries.norm[0, lane], entries.norm[1, lane]
        error = 0.0
        if sum5 != 0.0 or sum3 != 0.0:
            error = control.length[lane] * sum5 / math.sqrt((sum5 + 0.01 * sum3) * accuracy.controlled)
        finite = entries.chosen[0, lane] == 1.0
        control.error[lane] = error if finite else math.inf
        entries.chosen[0, lane] = 1.0 if control.status[lane] == RUNNING and finite and error < 1.0 else 0.0


@helper
def _first_step(problem, s, entries, control, accuracy, counts):
    """First step sizes: Hairer, Norsett, Wanner I, II.4, as `flexmb.integrate.control.initial_step`."""
    _scaled_norms(s, accuracy)
    for lane in range(LANES):
        d0, d1 = _norm(entries.norm[0, lane], accuracy), _norm(entries.norm[1, lane], accuracy)
        h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
        control.length[lane] = min(h0, control.end[lane] - control.t[lane])
        control.error[lane] = d1
        entries.h[0, lane] = control.length[lane]
    for i in range(s.y.shape[0]):
        s.trial[i] = s.y[i] + s.h[0] * s.k[0, i]
    _set_times(entries, control, 1.0)
    status = lane_derivative(problem, s, 1, counts)
    if status != OK:
        return status
    for i in range(s.y.shape[0]):
        s.k[2, i] = s.k[1, i] - s.k[0, i]
    mark_finite(s.k[1], s.chosen)
    _scaled_norm_of(s, s.k[2], accuracy)
    for lane in range(LANES):
        h0, d1 = control.length[lane], control.error[lane]
        d2 = _norm(entries.norm[2, lane], accuracy) / h0
        h1 = max(1e-6, h0 * 1e-3) if d1 <= 1e-15 and d2 <= 1e-15 else (0.01 / max(d1, d2)) ** (1.0 / _ERROR_EXPONENT)
        span = control.end[lane] - control.t[lane]
        control.h[lane] = min(100.0 * h0, h1, span) if entries.chosen[0, lane] == 1.0 else h0
    return OK


@helper
def _norm(total, accuracy):
    """Root mean square from a sum of squares."""
    return math.sqrt(total / accuracy.controlled) if accuracy.controlled > 0 else 0.0


@helper
def _scaled_norms(s, accuracy):
    """Sums of squares of y and of its slope k[0] over atol + rtol |y|, into s.norm[0] and s.norm[1]."""
    state, slope = 0.0, 0.0
    for i in range(accuracy.controlled):
        scale = accuracy.atol + accuracy.rtol * abs(s.y[i])
        a, b = s.y[i] / scale, s.k[0, i] / scale
        state += a * a
        slope += b * b
    s.norm[0], s.norm[1] = state, slope


@helper
def _scaled_norm_of(s, values, accuracy):
    """The same of values (n,), into s.norm[2]."""
    total = 0.0
    for i in range(accuracy.controlled):
        a = values[i] / (accuracy.atol + accuracy.rtol * abs(s.y[i]))
        total += a * a
    s.norm[2] = total


@helper
def _interpolant(problem, s, entries, control, counts):
    """Coefficients s.f (7,n) of the interpolant of order 7 on the step from y to y_new; three more stages."""
    for stage in range(STAGES + 1, STAGES_DENSE):
        _combine(s, A[stage], stage)
        _set_times(entries, control, C[stage])
        status = lane_derivative(problem, s, stage, counts)
        if status != OK:
            return status
    h = s.h[0]
    for i in range(s.y.shape[0]):
        change = s.y_new[i] - s.y[i]
        s.f[0, i] = change
        s.f[1, i] = h * s.k[0, i] - change
        s.f[2, i] = 2.0 * change - h * (s.k[_END, i] + s.k[0, i])
        for row in range(4):
            s.f[3 + row, i] = h * _weighted_sum(D[row], D.shape[1], s.k, i)
    return OK


@helper
def _interpolate(s):
    """s.trial = y + x (f0 + (1-x) (f1 + x (f2 + (1-x) (f3 + ...)))) at the fractions x of the steps."""
    x = s.fraction[0]
    for i in range(s.y.shape[0]):
        value = s.f[6, i] * x
        for row in range(5, -1, -1):
            value = (value + s.f[row, i]) * (x if row % 2 == 0 else 1.0 - x)
        s.trial[i] = s.y[i] + value


@helper
def _awaits(control, times, counts, lane):
    """Whether the step of a lane that has accepted it holds one more sample."""
    sample = counts[lane, SAMPLES]
    return sample < times.shape[0] and times[sample] <= control.end[lane]


@helper
def _store_samples(problem, s, entries, control, times, out, counts):
    """Samples in the steps that were accepted, their ends included; inside by the interpolant, if a lane needs it.

    Each round stores one sample of every lane that awaits one. Interpolated states are projected.
    """
    built = False
    while True:
        waiting, inside = False, False
        for lane in range(LANES):
            entries.fraction[0, lane], entries.time[0, lane] = 1.0, control.end[lane]
            if entries.chosen[0, lane] == 1.0 and _awaits(control, times, counts, lane):
                waiting = True
                time = times[counts[lane, SAMPLES]]
                if time < control.end[lane]:
                    inside = True
        if not waiting:
            return OK
        if inside:
            if not built:
                status = _interpolant(problem, s, entries, control, counts)
                if status != OK:
                    return status
                built = True
            for lane in range(LANES):
                if entries.chosen[0, lane] == 1.0 and _awaits(control, times, counts, lane):
                    time = times[counts[lane, SAMPLES]]
                    entries.time[0, lane] = time
                    entries.fraction[0, lane] = (time - control.t[lane]) / (control.end[lane] - control.t[lane])
            _interpolate(s)
            problem.project(problem.stages, problem.constants)
        for lane in range(LANES):
            if entries.chosen[0, lane] == 1.0 and _awaits(control, times, counts, lane):
                sample = counts[lane, SAMPLES]
                at_end = times[sample] == control.end[lane]
                store_lane(entries.y_new if at_end else entries.trial, lane, out[lane, sample])
                counts[lane, SAMPLES] = sample + 1


@helper
def _begin(problem, s, entries, control, clock, out, counts):
    """Initial states put on their manifolds; they are the first samples, and every lane enters its first segment."""
    times, segment_ends = clock
    set_all(entries.time, times[0])
    lane_copy(s.y, s.trial)
    problem.project(problem.stages, problem.constants)
    lane_copy(s.trial, s.y)
    for lane in range(LANES):
        store_lane(entries.y, lane, out[lane, 0])
        counts[lane, SAMPLES] = 1
        control.t[lane], control.error_before[lane] = times[0], CALM
        control.status[lane] = RUNNING
        _enter(control, segment_ends, lane)


@helper
def _enter(control, segment_ends, lane):
    """The next segment of a lane, or its end."""
    segment = control.segment[lane]
    if segment == control.ends[lane]:
        control.status[lane] = OK
    else:
        control.end[lane] = segment_ends[lane, segment]
        control.last[lane] = np.nextafter(control.end[lane], control.t[lane])
        control.rejected[lane] = 0


@helper
def _propose(entries, control, segment_ends, accuracy, counts):
    """End and length of the step that each lane tries; of no length where it has ended."""
    for lane in range(LANES):
        t = control.t[lane]
        end = t
        if control.status[lane] == RUNNING:
            last = segment_ends[lane, control.segment[lane]]
            status, end = step_end(t, control.h[lane], last, STEP_TOO_SMALL, accuracy.max_steps, counts[lane])
            if status != OK:
                control.status[lane] = status
                end = t
        control.end[lane] = end
        control.length[lane] = end - t
        entries.h[0, lane] = control.length[lane]


@helper
def _go_on(entries, control, segment_ends, counts):
    """Each lane's next time and step, after the verdict; returns whether one has entered another segment."""
    entered = False
    for lane in range(LANES):
        if control.status[lane] != RUNNING:
            continue
        length, error, rejected = control.length[lane], control.error[lane], control.rejected[lane] == 1
        if entries.chosen[0, lane] == 1.0:
            end = control.end[lane]
            cut = end == segment_ends[lane, control.segment[lane]]
            factor = step_factor(error, control.error_before[lane], _ERROR_EXPONENT, rejected)
            control.h[lane] = next_step(control.h[lane], length, factor, cut)
            control.t[lane], control.error_before[lane] = end, error
            control.rejected[lane] = 0
            counts[lane, ACCEPTED] += 1
            if cut:
                control.segment[lane] += 1
                _enter(control, segment_ends, lane)
                entered = entered or control.status[lane] == RUNNING
        else:
            factor = shorter(error, _ERROR_EXPONENT) if math.isfinite(error) else retreat(NONFINITE)
            control.h[lane] = length * factor
            control.rejected[lane] = 1
            counts[lane, REJECTED] += 1
    return entered


@helper
def _attempt(problem, s, entries, control, accuracy, counts):
    """One trial step of all lanes: s.y_new, projected, and its slope; marks the lanes that accept it."""
    status = _stages(problem, s, entries, control, counts)
    if status != OK:
        return status
    _judge(s, entries, control, accuracy)
    if not any_chosen(entries):
        return OK
    for lane in range(LANES):
        entries.time[0, lane] = control.end[lane]
    problem.project(problem.stages, problem.constants)
    lane_copy(s.trial, s.y_new)
    for lane in range(LANES):
        entries.time[0, lane] = min(control.end[lane], control.last[lane])
    status = lane_derivative(problem, s, _END, counts)
    if status != OK:
        return status
    accepted = s.chosen[0]
    mark_finite(s.k[_END], s.chosen)
    s.chosen[0] = select(accepted > 0.0, s.chosen[0], 0.0)
    for lane in range(LANES):
        if control.error[lane] < 1.0 and entries.chosen[0, lane] == 0.0:
            control.error[lane] = math.inf
    return OK


@helper
def _derivative_at_start(problem, s, entries, control, counts):
    """k[0] of all lanes at their times, from the right: it may jump where a segment ends. Ends runs that have none."""
    for lane in range(LANES):
        entries.time[0, lane] = control.t[lane]
    lane_copy(s.y, s.trial)
    status = lane_derivative(problem, s, 0, counts)
    mark_finite(s.k[0], s.chosen)
    for lane in range(LANES):
        if control.status[lane] == RUNNING and entries.chosen[0, lane] == 0.0:
            control.status[lane] = NONFINITE
    return status


@helper
def _running(control):
    found = False
    for lane in range(LANES):
        found = found or control.status[lane] == RUNNING
    return found


@kernel
def dop853_lanes(problem, s, entries, control, clock, accuracy, out, counts):
    """Integrate from the states s.y (n,LANES) as `dop853` does each of them; returns a status code.

    clock: times (T,) of the output and ends (LANES,S) of each lane's segments. out (LANES,T,n), counts (LANES,COUNTS).
    The status is OK unless no lane can go on; control.status (LANES,) is OK for lanes that have reached their ends.
    """
    times, segment_ends = clock
    _begin(problem, s, entries, control, clock, out, counts)
    status = _derivative_at_start(problem, s, entries, control, counts)
    if status == OK:
        status = _first_step(problem, s, entries, control, accuracy, counts)
    if status != OK:
        return status
    while _running(control):
        _propose(entries, control, segment_ends, accuracy, counts)
        status = _attempt(problem, s, entries, control, accuracy, counts)
        if status == OK and any_chosen(entries):
            status = _store_samples(problem, s, entries, control, times, out, counts)
            accepted = s.chosen[0] > 0.0
            for i in range(s.y.shape[0]):
                s.y[i] = select(accepted, s.y_new[i], s.y[i])
                s.k[0, i] = select(accepted, s.k[_END, i], s.k[0, i])
        if status != OK:
            return status
        if _go_on(entries, control, segment_ends, counts):
            status = _derivative_at_start(problem, s, entries, control, counts)
            if status != OK:
                return status
    return OK
