"""Steps over a place where y' = f(t, y) is not defined although the motion passes it smoothly: no stage is near it.

Closed chains have such places, singular positions; trees have none. A step fails near one, whatever its length; the
methods then come closer by shorter steps until the problem itself can leap, from one side to the other.
"""

from __future__ import annotations

from flexmb.integrate.control import ACCEPTED, EVALUATIONS, Interval, copy
from flexmb.integrate.dense_output import store_samples
from flexmb.integrate.watch import CROSSED, pause
from flexmb.jit.kernel import handed_on, helper
from flexmb.tables.status import BRANCH_UNKNOWN, CLOSURE_OPEN, CLOSURE_SINGULAR, OK

EVALUATED = 8  # about as often a leap evaluates equations of motion


@helper
def may_leap(status):
    """Whether a failure may be that of a place to leap over."""
    return status in (CLOSURE_SINGULAR, BRANCH_UNKNOWN, CLOSURE_OPEN)


@helper
def cubic(step, y, dy, y_new, dy_new, t, result):
    """The state within a leap, by Hermite's cubic: it is much shorter than a step."""
    h = step.end - step.start
    x = (t - step.start) / h
    for i in range(y.shape[0]):
        change = y_new[i] - y[i]
        bend = (1.0 - x) * (h * dy[i] - change) - x * (h * dy_new[i] - change)
        result[i] = y[i] + x * (change + (1.0 - x) * bend)


@handed_on
def in_leap(problem, step, ends, s, t, result, run):
    """The state within a leap, as `flexmb.integrate.watch` asks for it."""
    cubic(step, ends.y, ends.dy, ends.y_new, ends.dy_new, t, result)
    return OK


@helper
def leap_over(problem, watch, t, farthest, ends, samples, run):
    """Leap from the last good state, ends.y at t (s), over the place where steps fail, not beyond `farthest` (s).

    Stores the samples on the way and puts the state beyond, and its slope, into ends.y and ends.dy. Returns (OK, time
    reached, length of the leap), of length 0 where none is possible yet; (CROSSED, its time, .) where the leap comes to
    a level, with the times of the leap and its first state in `watch`; or the status of what fails. ends.y may change
    by rounding. samples: times of samples, and samples; run: accuracy and counts.
    """
    _, counts = run
    counts[EVALUATIONS] += EVALUATED
    length = problem.leap(farthest, ends.y, ends.dy, ends.y_new, ends.dy_new, problem.constants)
    if length > 0.0:
        step = Interval(t, t + length, farthest)
        if watch is not None:
            copy(ends.y, watch.before)
            status, t_at = pause(problem, watch, step, ends, in_leap, OK, samples, run)
            if status == CROSSED:
                watch.leap[0], watch.leap[1] = step.start, step.end
            if status != OK:
                return status, t_at, length
        store_samples(problem, step, ends, in_leap, OK, samples, run)
        copy(ends.y_new, ends.y)
        copy(ends.dy_new, ends.dy)
        counts[ACCEPTED] += 1
    return OK, t + length, length
