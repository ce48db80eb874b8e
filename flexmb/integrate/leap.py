"""Steps over a place where y' = f(t, y) is not defined although the motion passes it smoothly: no stage is near it.

Closed chains have such places, singular positions; trees have none. A step fails near one, whatever its length; the
methods then come closer by shorter steps until the problem itself can leap, from one side to the other.
"""

from __future__ import annotations

from flexmb.integrate.control import EVALUATIONS, SAMPLES, copy
from flexmb.jit.kernel import helper
from flexmb.tables.status import BRANCH_UNKNOWN, CLOSURE_OPEN, CLOSURE_SINGULAR

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
def between(x, h, y, dy):
    """The value of Hermite's cubic at the fraction x of an interval h, from values and slopes at both its ends."""
    change = y[1] - y[0]
    bend = (1.0 - x) * (h * dy[0] - change) - x * (h * dy[1] - change)
    return y[0] + x * (change + (1.0 - x) * bend)


@helper
def store_leapt(step, y, dy, y_new, dy_new, times, out, counts):
    """Store the samples in a leap by Hermite's cubic: it is much shorter than a step."""
    h, sample = step.end - step.start, counts[SAMPLES]
    while sample < times.shape[0] and times[sample] <= step.end:
        if times[sample] == step.end:
            copy(y_new, out[sample])
        else:
            x = (times[sample] - step.start) / h
            for i in range(y.shape[0]):
                out[sample, i] = between(x, h, (y[i], y_new[i]), (dy[i], dy_new[i]))
        sample += 1
    counts[SAMPLES] = sample
