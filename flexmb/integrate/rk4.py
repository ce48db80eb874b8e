"""The classical Runge-Kutta method of order 4 with a fixed step, whole runs in one compiled loop."""

from __future__ import annotations

import math

import numpy as np

from flexmb.integrate.control import (
    ACCEPTED,
    REJECTED,
    RETREAT,
    SAMPLES,
    Interval,
    all_finite,
    copy,
    derivative,
    permitted,
    step_end,
    stretch,
)
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.leap import leap_over, may_leap
from flexmb.integrate.memory import DONE, STRETCH, begin, keep_place
from flexmb.integrate.watch import Ends, pause
from flexmb.jit.kernel import handed_on, helper, kernel, written_out
from flexmb.tables.status import NONFINITE, OK


@written_out
def _stage(problem, t, y, slope, h, trial, dy, counts):
    """dy = f(t, y + h slope)."""
    for i in range(y.shape[0]):
        trial[i] = y[i] + h * slope[i]
    return derivative(problem, t, trial, dy, counts)


@written_out
def rk4_step(problem, t, last, y, h, k, trial, counts):
    """trial = y(t + h) from y(t). `k` (4, n) is scratch; no stage is later than `last`. Returns a status code."""
    status = derivative(problem, t, y, k[0], counts)
    if status == OK:
        status = _stage(problem, t + 0.5 * h, y, k[0], 0.5 * h, trial, k[1], counts)
    if status == OK:
        status = _stage(problem, t + 0.5 * h, y, k[1], 0.5 * h, trial, k[2], counts)
    if status == OK:
        status = _stage(problem, min(t + h, last), y, k[2], h, trial, k[3], counts)
    if status != OK:
        return status
    for i in range(y.shape[0]):
        trial[i] = y[i] + h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
    return OK if all_finite(trial) else NONFINITE


@handed_on
def inside(problem, step, ends, k, t, result, run):
    """The state within a step, by a shorter one from the same start, which is as accurate as the whole one."""
    status = rk4_step(problem, step.start, step.last, ends.y, t - step.start, k, result, run[1])
    if status == OK:
        problem.project(t, result, problem.constants)
    return status


@helper
def _detour(problem, watch, trouble, step, y, scratch, output, run):
    """From the last good state to `step.end` or further, by shorter steps and leaps, where a step there met `trouble`.

    Returns a status code and the time of y, which is again the last good state. scratch: slopes (4,n) and a state (n,);
    output: times of samples, and samples; run: accuracy and counts. CROSSED, and the time, where it comes to a level.
    """
    (k, trial), target, last, (accuracy, counts) = scratch, step.end, step.last, run
    t = problem.back(y, problem.constants)
    if not t > -math.inf:
        return trouble, target
    h, failed = RETREAT * (target - t), True
    while t < target:
        status = permitted(accuracy.max_steps, counts)
        if status != OK:
            return status, t
        if failed:
            status, t_at, length = leap_over(problem, watch, t, last, Ends(y, k[0], trial, k[1]), output, run)
            if status != OK:
                return status, t_at
            if length > 0.0:
                t, h, failed = t_at, length, False
                continue
        status, t_new = step_end(t, h, target, trouble, accuracy.max_steps, counts)
        if status != OK:
            return status, t
        status = rk4_step(problem, t, last, y, t_new - t, k, trial, counts)
        if status == OK:
            problem.project(t_new, trial, problem.constants)
            status = derivative(problem, min(t_new, last), trial, k[3], counts)
        if status != OK and not may_leap(status):
            return status, t
        failed = status != OK
        if failed:
            trouble, h = status, RETREAT * h
            counts[REJECTED] += 1
            continue
        if watch is not None:
            ends = Ends(y, k[0], trial, k[3])
            status, t_at = pause(problem, watch, Interval(t, t_new, last), ends, inside, k, output, run)
            if status != OK:
                return status, t_at
        t, h = t_new, 2.0 * h
        copy(trial, y)
        counts[ACCEPTED] += 1
    return OK, t


@kernel
def rk4(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y' = f(t, y) as told by `Integrator`.

    Every stretch between samples and segment ends is divided into equal steps not exceeding `accuracy.step`, and y is
    put back on its manifold after each.
    """
    times, segment_ends, _ = clock
    k, trial = np.empty((4, y.shape[0])), np.empty(y.shape[0])
    t = begin(problem, times, y, trial, memory, out, counts)
    start, done, segment = memory.numbers[STRETCH], int(memory.numbers[DONE]), 0
    for sample in range(counts[SAMPLES], times.shape[0]):
        while t < times[sample]:
            end, steps, h, last = stretch(start, times[sample], segment_ends[segment], accuracy.step)
            for j in range(done, steps):
                status = permitted(accuracy.max_steps, counts)
                if status != OK:
                    keep_place(memory, t, y, start, j)
                    return status, t
                status = rk4_step(problem, t, last, y, h, k, trial, counts)
                if may_leap(status):
                    failed = Interval(t, min(t + h, end), last)
                    scratch, output = (k, trial), (times, out)
                    status, t = _detour(problem, watch, status, failed, y, scratch, output, (accuracy, counts))
                    if status == OK:
                        break
                if status != OK:
                    return status, t
                if watch is not None:  # the last stage's slope is nearly that at the end
                    step, ends = Interval(t, t + h, last), Ends(y, k[0], trial, k[3])
                    status, t_at = pause(problem, watch, step, ends, inside, k, (times, out), (accuracy, counts))
                    if status != OK:
                        return status, t_at
                t = end if j == steps - 1 else start + (j + 1) * h
                copy(trial, y)
                problem.project(t, y, problem.constants)
                counts[ACCEPTED] += 1
            start, done = t, 0
            if t == segment_ends[segment]:
                segment += 1
        if counts[SAMPLES] == sample:  # not met within a leap
            copy(y, out[sample])
            counts[SAMPLES] = sample + 1
    keep_place(memory, t, y, t, 0)
    return OK, t


INTEGRATOR = Integrator(
    "rk4", rk4, order=4, fixed=True, evaluations=4, summary="comparison with codes of fixed steps"
)
