"""Leaps over states at which y' = f(t, y) is not defined although the motion is smooth: no stage is evaluated there.

Such states are the singular positions of closed chains; trees have none. Near one every step fails, whatever its size.
The methods then approach it by smaller steps until the problem itself can leap from one side to the other.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from flexmb.integrate.control import ACCEPTED, EVALUATIONS, Interval, copy
from flexmb.integrate.dense_output import store_samples
from flexmb.integrate.watch import CROSSED, pause, watches
from flexmb.jit.kernel import handed_on, helper, kernel
from flexmb.tables.status import BRANCH_UNKNOWN, CLOSURE_OPEN, CLOSURE_SINGULAR, OK

# Lobatto's rule of order 6 on a unit interval: both ends with weight 1/12, and INNER from either with 5/12.
INNER = 0.5 - math.sqrt(0.05)
EDGE_WEIGHT, INNER_WEIGHT = 1.0 / 12.0, 5.0 / 12.0


EVALUATED = 8  # approximate number of evaluations of the equations of motion in a leap


class LeapProblem(NamedTuple):
    """What of a problem the search for levels within a leap needs."""

    constants: Any


@helper
def may_leap(status):
    """Whether a failure may be due to a singular position, over which a leap may be possible."""
    return status in (CLOSURE_SINGULAR, BRANCH_UNKNOWN, CLOSURE_OPEN)


@helper
def cubic(step, y, dy, y_new, dy_new, t, result):
    """The state within a leap by Hermite's cubic; a leap is short enough for it, being much shorter than a step."""
    h = step.end - step.start
    x = (t - step.start) / h
    for i in range(y.shape[0]):
        change = y_new[i] - y[i]
        bend = (1.0 - x) * (h * dy[i] - change) - x * (h * dy_new[i] - change)
        result[i] = y[i] + x * (change + (1.0 - x) * bend)


@handed_on
def in_leap(problem, step, ends, s, t, result, run):
    """The state within a leap; see `state_at` in `flexmb.integrate.watch`."""
    cubic(step, ends.y, ends.dy, ends.y_new, ends.dy_new, t, result)
    return OK


@kernel
def leap_over(leap, constants, watch, t, farthest, ends, samples, run):
    """Leap from the last good state, ends.y at t (s), over a singular position, not beyond `farthest` (s).

    A kernel of its own, which all integrators share; `leap` and `constants` are those of the problem.

    Stores the samples in between and puts the state after the leap, and its slope, into ends.y and ends.dy. Returns
    (OK, time reached, length of the leap), with length 0 if no leap is possible yet; (CROSSED, time, .) if the leap
    reaches a level, with the times of the leap and its first state in `watch`; or the status of a failure. ends.y may
    change by rounding. samples: times of samples, and samples; run: accuracy and counts.
    """
    _, counts = run
    counts[EVALUATIONS] += EVALUATED
    problem = LeapProblem(constants)
    length = leap(farthest, ends.y, ends.dy, ends.y_new, ends.dy_new, constants)
    if length > 0.0:
        step = Interval(t, t + length, farthest)
        if watches(watch):
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
