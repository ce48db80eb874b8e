"""The loop over segments and steps of the methods that adapt their steps.

When a step is accepted, it is first searched for crossings of watched levels, then its samples are stored, then its end
becomes the last good state. A step whose right-hand side fails is repeated with a smaller size, which may suffice. Near
a singular position of a closed chain, where no smaller step succeeds, the run leaps (`flexmb.integrate.leap`). When a
step becomes too short to advance time, the run ends with the status of the failure.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flexmb.integrate.control import (
    ACCEPTED,
    CALM,
    REJECTED,
    Interval,
    copy,
    enter_segment,
    next_step,
    reason,
    retreat,
    shorter,
    step_end,
    step_factor,
)
from flexmb.integrate.dense_output import store_samples
from flexmb.integrate.leap import leap_over, may_leap
from flexmb.integrate.memory import ERROR_BEFORE, RETRIED, STEP, begin, keep
from flexmb.integrate.watch import keep_sides, pause, watches
from flexmb.jit.kernel import handed_in, helper
from flexmb.tables.status import OK, STEP_TOO_SMALL


class Method(NamedTuple):
    """The functions of a method that the loop calls. `known` (NUMBERS,) holds the numbers of
    `flexmb.integrate.memory.Memory` before a step, s the arrays of the method. All functions except `state_at` are
    marked by `handed_in`:

    attempt(problem, step, ends, s, known, accuracy, counts) -> (status code, verdict) tries a step: its end, projected,
    goes into ends.y_new and, where the step is accepted, the slope there into ends.dy_new. verdict: a tuple whose first
    entry is the error norm, 1 being just acceptable.
    accept(step, cut, verdict, s, known, exponent) puts the size of the next step into known[STEP]; `cut`: the step ends
    with its segment.
    reject(step, status, verdict, s, known, exponent) does so after a step that failed or had too large an error.
    after_leap(length, cut, known, exponent) does so after a leap of this length (s).
    enter(known) discards what is not valid across the end of a segment.
    recall(problem, memory, s, known, counts) and keep(memory, s) read and write all else that the method needs to
    resume a run.
    state_at: see `flexmb.integrate.watch`.
    exponent: the error estimate is O(h^exponent).
    """

    attempt: Any
    accept: Any
    reject: Any
    after_leap: Any
    enter: Any
    recall: Any
    keep: Any
    state_at: Any
    exponent: float


@helper
def adaptive(method, problem, arrays, clock, out, run, memory, watch):
    """Integrate y' = f(t, y) from ends.y as described in `Integrator`: (status code, time of the last good state).

    arrays: s and `Ends`; run: accuracy and counts.
    """
    attempt, accept, reject, after_leap, enter, recall, keep_more, state_at, exponent = method
    times, segment_ends, farthest = clock
    s, ends = arrays
    accuracy, counts = run
    y, samples = ends.y, (times, out)
    t = begin(problem, times, y, ends.y_new, memory, out, counts)
    known, kept = memory.numbers.copy(), False
    recall(problem, memory, s, known, counts)
    for i in range(segment_ends.shape[0]):
        end, is_last = segment_ends[i], i + 1 == segment_ends.shape[0]
        last = np.nextafter(end, t)
        segment, trouble = Interval(t, end, last), STEP_TOO_SMALL
        status, known[STEP] = enter_segment(problem, segment, y, ends.dy, known[STEP], accuracy, exponent, counts)
        if status != OK:
            return status, t
        while t < end:
            status, t_new = step_end(t, known[STEP], end, trouble, accuracy.max_steps, counts)
            if not kept and (status != OK or (is_last and t_new == end)):
                keep(memory, t, y, known, counts)
                keep_more(memory, s)
                keep_sides(watch)
                kept = True
            if status != OK:
                return status, t
            step = Interval(t, t_new, last)
            status, verdict = attempt(problem, step, ends, s, known, accuracy, counts)
            trouble = reason(status)
            if may_leap(status):
                limit = farthest if is_last and farthest > end else last
                passed, t_at, length = leap_over(problem.leap, problem.constants, watch, t, limit, ends, samples, run)
                if passed != OK:
                    return passed, t_at
                if length > 0.0:
                    t = t_at
                    after_leap(length, t == end, known, exponent)
                    continue
            if status == OK and verdict[0] < 1.0:
                if watches(watch):
                    status, t_at = pause(problem, watch, step, ends, state_at, s, samples, run)
                    if status != OK:
                        return status, t_at
                status = store_samples(problem, step, ends, state_at, s, samples, run)
                if status != OK:
                    return status, t
                accept(step, t_new == end, verdict, s, known, exponent)
                t = t_new
                copy(ends.y_new, y)
                copy(ends.dy_new, ends.dy)
                counts[ACCEPTED] += 1
            else:
                reject(step, status, verdict, s, known, exponent)
                counts[REJECTED] += 1
        enter(known)
    if not kept:
        keep(memory, t, y, known, counts)
        keep_more(memory, s)
    return OK, t


@handed_in
def accept_by_error(step, cut, verdict, s, known, exponent):
    """Size of the next step from the errors of this step and the one before."""
    length, error = step.end - step.start, verdict[0]
    factor = step_factor(error, known[ERROR_BEFORE], exponent, known[RETRIED] != 0.0)
    known[STEP] = next_step(known[STEP], length, factor, cut)
    known[ERROR_BEFORE], known[RETRIED] = error, 0.0


@handed_in
def reject_by_error(step, status, verdict, s, known, exponent):
    """Size of the next trial after a step that failed or whose error was too large."""
    length = step.end - step.start
    known[STEP] = length * (shorter(verdict[0], exponent) if status == OK else retreat(status))
    known[RETRIED] = 1.0


@handed_in
def after_leap_by_error(length, cut, known, exponent):
    """Size of the next step after a leap, as after a step of the same length with a small error."""
    factor = step_factor(CALM, known[ERROR_BEFORE], exponent, known[RETRIED] != 0.0)
    known[STEP] = next_step(known[STEP], length, factor, cut)
    known[ERROR_BEFORE], known[RETRIED] = CALM, 0.0


@handed_in
def enter_afresh(known):
    """Start a new segment, in which no step has been rejected."""
    known[RETRIED] = 0.0


@handed_in
def recall_nothing(problem, memory, s, known, counts):
    """For methods whose only memory is the numbers of `Memory`."""


@handed_in
def keep_nothing(memory, s):
    """For methods whose only memory is the numbers of `Memory`."""


@helper
def by_error(attempt, state_at, exponent):
    """A method whose steps follow from its errors alone, and whose only memory is the numbers of `Memory`."""
    return Method(
        attempt, accept_by_error, reject_by_error, after_leap_by_error, enter_afresh, recall_nothing, keep_nothing,
        state_at, exponent,
    )  # fmt: skip
