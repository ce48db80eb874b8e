"""Steps over a place where y' = f(t, y) is not defined although the motion passes it smoothly: no stage is near it.

Closed chains have such places, singular positions; trees have none. A step fails near one, whatever its length; the
methods then come closer by shorter steps until the problem itself can leap, from one side to the other.
"""

from __future__ import annotations

from flexmb.integrate.control import EVALUATIONS, SAMPLES, copy
from flexmb.integrate.watch import CROSSED, pause
from flexmb.jit.kernel import handed_on, helper, sweep
from flexmb.tables.status import BRANCH_UNKNOWN, CLOSURE_OPEN, CLOSURE_SINGULAR, OK

EVALUATED = 8  # about as often a leap evaluates equations of motion


@helper
def may_leap(status):
    """Whether a failure may be that of a place to leap over."""
    return status in (CLOSURE_SINGULAR, BRANCH_UNKNOWN, CLOSURE_OPEN)


@helper
def leap(problem, end, y, dy, y_new, dy_new, counts):
    """Length of the leap from y, the last good state, to y_new, not beyond `end`; 0 where none is possible yet.

    dy, dy_new: slopes there. y may change by rounding.
    """
    counts[EVALUATIONS] += EVALUATED
    return problem.leap(end, y, dy, y_new, dy_new, problem.constants)


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


@sweep
def pause_in_leap(problem, watch, step, ends, samples, run):
    """As `flexmb.integrate.watch.pause`; of a leap that comes to a level, watch keeps its times and where it starts."""
    copy(ends.y, watch.before)
    status, t = pause(problem, watch, step, ends, in_leap, OK, samples, run)
    if status == CROSSED:
        watch.leap[0], watch.leap[1] = step.start, step.end
    return status, t


@helper
def store_leapt(step, y, dy, y_new, dy_new, times, out, counts):
    """Store the samples in a leap."""
    sample = counts[SAMPLES]
    while sample < times.shape[0] and times[sample] <= step.end:
        if times[sample] == step.end:
            copy(y_new, out[sample])
        else:
            cubic(step, y, dy, y_new, dy_new, times[sample], out[sample])
        sample += 1
    counts[SAMPLES] = sample
