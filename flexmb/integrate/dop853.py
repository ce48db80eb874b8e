"""DOP853: Runge-Kutta of order 8 with error control and dense output of order 7, whole runs in one compiled loop.

Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), II.5 and II.10. A step ends in this order:
error test, projection of the new state, derivative at the projected state. That derivative is the first stage of the
next step and belongs to the interpolant: both are consistent with the projected state, and projection costs no order.
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
    Interval,
    all_finite,
    copy,
    derivative,
    enter_segment,
    next_step,
    reason,
    retreat,
    shorter,
    step_end,
    step_factor,
)
from flexmb.integrate.dop853_tableau import E3, E5, STAGES, STAGES_DENSE, A, C, D
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.leap import leap, may_leap, pause_in_leap, store_leapt
from flexmb.integrate.memory import ERROR_BEFORE, RETRIED, STEP, begin, keep
from flexmb.integrate.watch import Ends, Within, end_at_crossing, keep_sides, meets
from flexmb.jit.kernel import handed_on, helper, kernel
from flexmb.tables.status import NONFINITE, OK, STEP_TOO_SMALL

END = STAGES  # row of A with the weights of the result; k[END] is the derivative there
ERROR_EXPONENT = 8.0  # the error estimate is O(h^8)


class ExplicitStages(NamedTuple):
    """Arrays of a step: slopes k (STAGES_DENSE,n), the new state (n,), coefficients f (7,n) of the interpolant."""

    k: np.ndarray
    y_new: np.ndarray
    f: np.ndarray


@helper
def weighted_sum(weights, count, k, i):
    """Sum over j < count of weights[j] k[j, i]."""
    total = 0.0
    for j in range(count):
        total += weights[j] * k[j, i]
    return total


@helper
def combine(y, h, row, k, result):
    """result = y + h * sum over j < row of A[row, j] k[j], along rows of k and past the many zeros of A."""
    n = y.shape[0]
    for i in range(n):
        result[i] = A[row, 0] * k[0, i]
    for j in range(1, row):
        a = A[row, j]
        if a != 0.0:
            for i in range(n):
                result[i] += a * k[j, i]
    for i in range(n):
        result[i] = y[i] + h * result[i]


@helper
def stages(problem, t, last, y, h, k, trial, counts):
    """Stages 1 to 11 (stage 0 is given), then trial = y(t + h). No stage is evaluated later than `last`."""
    for s in range(1, STAGES + 1):
        combine(y, h, s, k, trial)
        if s == END:
            break
        status = derivative(problem, min(t + C[s] * h, last), trial, k[s], counts)
        if status != OK:
            return status
    return OK if all_finite(trial) else NONFINITE


@helper
def error_norm(y, y_new, h, k, accuracy):
    """Hairer's blend of the 5th and 3rd order error estimates over the tolerance: 1 is just acceptable."""
    sum5, sum3 = 0.0, 0.0
    for i in range(accuracy.controlled):
        scale = accuracy.atol + accuracy.rtol * max(abs(y[i]), abs(y_new[i]))
        error5 = weighted_sum(E5, E5.shape[0], k, i) / scale
        error3 = weighted_sum(E3, E3.shape[0], k, i) / scale
        sum5 += error5 * error5
        sum3 += error3 * error3
    if sum5 == 0.0 and sum3 == 0.0:
        return 0.0
    return h * sum5 / math.sqrt((sum5 + 0.01 * sum3) * accuracy.controlled)


@helper
def interpolant(problem, step, y, s, trial, counts):
    """Coefficients s.f (7, n) of the interpolant of order 7 on the step from y to s.y_new; three more stages."""
    h, k, f = step.end - step.start, s.k, s.f
    for stage in range(STAGES + 1, STAGES_DENSE):
        combine(y, h, stage, k, trial)
        status = derivative(problem, min(step.start + C[stage] * h, step.last), trial, k[stage], counts)
        if status != OK:
            return status
    for i in range(y.shape[0]):
        change = s.y_new[i] - y[i]
        f[0, i] = change
        f[1, i] = h * k[0, i] - change
        f[2, i] = 2.0 * change - h * (k[END, i] + k[0, i])
        for row in range(4):
            f[3 + row, i] = h * weighted_sum(D[row], D.shape[1], k, i)
    return OK


@helper
def interpolate(y, f, x, result):
    """result = y + x (f0 + (1-x) (f1 + x (f2 + (1-x) (f3 + ...)))): the state at the fraction x of the step."""
    for i in range(y.shape[0]):
        value = 0.0
        for row in range(6, -1, -1):
            value = (value + f[row, i]) * (x if row % 2 == 0 else 1.0 - x)
        result[i] = y[i] + value


@helper
def store_samples(problem, step, y, s, times, out, counts):
    """Store the samples in the step, its end included; inside by the interpolant, built only where it is needed.

    Interpolated states are projected, so that quaternions are unit and prescribed coordinates exact there too.
    """
    sample = counts[SAMPLES]
    built = False
    while sample < times.shape[0] and times[sample] <= step.end:
        if times[sample] == step.end:
            copy(s.y_new, out[sample])
        else:
            if not built:
                status = interpolant(problem, step, y, s, out[sample], counts)
                if status != OK:
                    return status
                built = True
            interpolate(y, s.f, (times[sample] - step.start) / (step.end - step.start), out[sample])
            problem.project(times[sample], out[sample], problem.constants)
        sample += 1
        counts[SAMPLES] = sample
    return OK


@handed_on
def state_at(problem, step, ends, s, t, result, run):
    """The state inside a step whose interpolant is built, projected; see `flexmb.integrate.watch`."""
    interpolate(ends.y, s.f, (t - step.start) / (step.end - step.start), result)
    problem.project(t, result, problem.constants)
    return OK


@helper
def attempt(problem, step, y, s, accuracy, counts):
    """One trial step: s.y_new, projected, and its slope s.k[END]. Returns (status, error norm)."""
    h = step.end - step.start
    status = stages(problem, step.start, step.last, y, h, s.k, s.y_new, counts)
    if status != OK:
        return status, math.inf
    error = error_norm(y, s.y_new, h, s.k, accuracy)
    if error < 1.0:
        problem.project(step.end, s.y_new, problem.constants)
        status = derivative(problem, min(step.end, step.last), s.y_new, s.k[END], counts)
    return status, error


@helper
def pause_within(problem, watch, step, leapt, y, s, samples, run):
    """y at the first level that a step, or a leap, comes to: (CROSSED, the time); (OK, .) where it comes to none."""
    ends, trial = Ends(y, s.k[0], s.y_new, s.k[END]), np.empty(y.shape[0])
    if leapt:
        return pause_in_leap(problem, watch, step, ends, samples, run)
    status, some = meets(problem, watch, step, ends)
    if status == OK and some:
        status = interpolant(problem, step, y, s, trial, run[1])
    if status != OK or not some:
        return status, step.start
    return end_at_crossing(Within(problem, watch, step, ends, state_at, s, trial, run), samples[0], samples[1])


@kernel
def dop853(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y' = f(t, y) as told by `Integrator`.

    A step whose right-hand side fails is retried shorter: it may only have reached too far. When the step gets too
    short to advance time, the failure's own status is returned.
    """
    times, segment_ends = clock
    n = y.shape[0]
    s = ExplicitStages(np.empty((STAGES_DENSE, n)), np.empty(n), np.empty((7, n)))
    t = begin(problem, times, y, s.y_new, memory, out, counts)
    h, error_before, kept = memory.numbers[STEP], memory.numbers[ERROR_BEFORE], False
    rejected, trouble = memory.numbers[RETRIED] != 0.0, STEP_TOO_SMALL
    for i in range(segment_ends.shape[0]):
        end, is_last = segment_ends[i], i + 1 == segment_ends.shape[0]
        last = np.nextafter(end, t)
        segment = Interval(t, end, last)
        status, h = enter_segment(problem, segment, y, s.k[0], h, accuracy, ERROR_EXPONENT, counts)
        if status != OK:
            return status, t
        while t < end:
            status, t_new = step_end(t, h, end, trouble, accuracy.max_steps, counts)
            if not kept and (status != OK or (is_last and t_new == end)):
                keep(memory, t, y, h, error_before, rejected, counts)
                if watch is not None:
                    keep_sides(watch)
                kept = True
            if status != OK:
                return status, t
            step, length = Interval(t, t_new, last), t_new - t
            status, error = attempt(problem, step, y, s, accuracy, counts)
            trouble, leapt = reason(status), False
            if may_leap(status):
                far = leap(problem, last, y, s.k[0], s.y_new, s.k[END], counts)
                if far > 0.0:
                    t_new, length, status, error = t + far, far, OK, CALM
                    step, leapt = Interval(t, t_new, last), True
            accepted = status == OK and error < 1.0
            if accepted:
                if watch is not None:
                    status, t_at = pause_within(problem, watch, step, leapt, y, s, (times, out), (accuracy, counts))
                    if status != OK:
                        return status, t_at
                if leapt:
                    store_leapt(step, y, s.k[0], s.y_new, s.k[END], times, out, counts)
                else:
                    status = store_samples(problem, step, y, s, times, out, counts)
                if status != OK:
                    return status, t
                factor = step_factor(error, error_before, ERROR_EXPONENT, rejected)
                h = next_step(h, length, factor, t_new == end)
                t, error_before = t_new, error
                copy(s.y_new, y)
                copy(s.k[END], s.k[0])
                counts[ACCEPTED] += 1
            else:
                h = length * (shorter(error, ERROR_EXPONENT) if status == OK else retreat(status))
                counts[REJECTED] += 1
            rejected = not accepted
        rejected, trouble = False, STEP_TOO_SMALL
    if not kept:
        keep(memory, t, y, h, error_before, rejected, counts)
    return OK, t


INTEGRATOR = Integrator(
    "dop853", dop853, order=8, evaluations=11,
    summary="the default: everything whose fastest mode matters, or is not a thousand times faster than what does",
)  # fmt: skip
