"""The classical Runge-Kutta method of order 4 with a fixed step. Its formulas serve one run, and eight in lanes."""

from __future__ import annotations

import math

import numpy as np

from flexmb.integrate.control import (
    ACCEPTED,
    REJECTED,
    RETREAT,
    Interval,
    all_finite,
    copy,
    derivative,
    permitted,
    step_end,
)
from flexmb.integrate.equal_steps import FixedMethod, equal_steps
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.leap import leap_over, may_leap
from flexmb.integrate.watch import Ends, pause, watches
from flexmb.jit.kernel import handed_in, handed_on, helper, kernel, written_out
from flexmb.tables.status import NONFINITE, OK


@helper
def advance(y, h, slope, result):
    """result = y + h slope."""
    for i in range(y.shape[0]):
        result[i] = y[i] + h * slope[i]


@helper
def weigh(y, h, k, result):
    """result = y + h times the weighted mean of the four slopes k (4,n)."""
    for i in range(y.shape[0]):
        result[i] = y[i] + h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])


@written_out
def _stage(problem, t, y, slope, h, trial, dy, counts):
    """dy = f(t, y + h slope)."""
    advance(y, h, slope, trial)
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
    weigh(y, h, k, trial)
    return OK if all_finite(trial) else NONFINITE


@handed_in
def attempt(problem, step, h, ends, k, known, accuracy, counts):
    """See `FixedMethod`. The slope of the last stage is nearly that at the end."""
    status = rk4_step(problem, step.start, step.last, ends.y, h, k, ends.y_new, counts)
    if status == OK:
        problem.project(step.end, ends.y_new, problem.constants)
    return status


@handed_on
def inside(problem, step, ends, k, t, result, run):
    """The state within a step, by a shorter one from the same start, which is as accurate as the whole one."""
    status = rk4_step(problem, step.start, step.last, ends.y, t - step.start, k, result, run[1])
    if status == OK:
        problem.project(t, result, problem.constants)
    return status


@handed_in
def detour(problem, watch, trouble, step, ends, k, samples, run):
    """See `FixedMethod`: by shorter steps and leaps from the last good state, where a step met `trouble`."""
    y, target, last, (accuracy, counts) = ends.y, step.end, step.last, run
    t = problem.back(y, problem.constants)
    if not t > -math.inf:
        return trouble, target
    h, failed = RETREAT * (target - t), True
    while t < target:
        status = permitted(accuracy.max_steps, counts)
        if status != OK:
            return status, t
        if failed:
            status, t_at, length = leap_over(problem.leap, problem.constants, watch, t, last, ends, samples, run)
            if status != OK:
                return status, t_at
            if length > 0.0:
                t, h, failed = t_at, length, False
                continue
        status, t_new = step_end(t, h, target, trouble, accuracy.max_steps, counts)
        if status != OK:
            return status, t
        status = rk4_step(problem, t, last, y, t_new - t, k, ends.y_new, counts)
        if status == OK:
            problem.project(t_new, ends.y_new, problem.constants)
            status = derivative(problem, min(t_new, last), ends.y_new, ends.dy_new, counts)
        if status != OK and not may_leap(status):
            return status, t
        failed = status != OK
        if failed:
            trouble, h = status, RETREAT * h
            counts[REJECTED] += 1
            continue
        if watches(watch):
            status, t_at = pause(problem, watch, Interval(t, t_new, last), ends, inside, k, samples, run)
            if status != OK:
                return status, t_at
        t, h = t_new, 2.0 * h
        copy(ends.y_new, y)
        counts[ACCEPTED] += 1
    return OK, t


@handed_in
def accept(k):
    """See `FixedMethod`: a step needs nothing of the steps before it."""


@handed_in
def enter(known):
    """See `FixedMethod`: a step needs nothing of the steps before it."""


@handed_in
def recall(problem, memory, k, known, accuracy, counts):
    """See `FixedMethod`: a step needs nothing of the steps before it."""


@handed_in
def keep(memory, k):
    """See `FixedMethod`: a step needs nothing of the steps before it."""


@kernel
def rk4(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y' = f(t, y) as told by `Integrator`, y being put back on its manifold after each step."""
    k = np.empty((4, y.shape[0]))
    ends = Ends(y, k[0], np.empty(y.shape[0]), k[3])
    method = FixedMethod(attempt, detour, accept, enter, recall, keep, inside, k)
    return equal_steps(method, problem, (k, ends), clock, out, (accuracy, counts), memory, watch)


INTEGRATOR = Integrator(
    "rk4", rk4, order=4, fixed=True, evaluations=4, summary="comparison with codes of fixed steps"
)
