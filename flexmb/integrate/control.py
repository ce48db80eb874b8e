"""Common parts of all integrators: checked derivatives and Jacobians, error norm, first step, step-size control, equal
steps.

The last components of a state y (n,) may be pure quadratures: only the first `controlled` ones enter a norm (see
`Accuracy`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.jit.kernel import helper, written_out
from flexmb.tables.status import INTERRUPTED, MAX_STEPS, NONFINITE, NOT_CONVERGED, OK, STEP_TOO_SMALL

SAFETY = 0.9
SHRINK = 0.2  # strongest change of step after a rejection ...
GROW = 10.0  # ... and after an acceptance
# Exponent of the previous error in the step-size controller: beta of Hairer, Norsett, Wanner II, IV.2.
DAMPING = 0.04
CALM = 1e-4  # lower bound of the previous error in the controller, and its value before the first step
RETREAT = 0.1  # factor on the step after a right-hand side that could not be evaluated
HALVED = 0.5  # factor on the step after an iteration that did not converge
# A fixed step may exceed the one requested by this fraction, so that 0.1 s is divided into 10 steps of 0.01 s however
# 0.1 / 0.01 is rounded.
_STEP_SLACK = 1e-9
_ADVANCING = 1e3  # lower bound of the first step in ulp(t), because a guess from a state at rest may be too short

# Entries of `counts`: evaluations, steps, samples stored, Jacobians, and factorisations or exponentials of a matrix.
# STOP is not a count: another thread sets it during a run to end the run.
EVALUATIONS, ACCEPTED, REJECTED, SAMPLES, STOP, JACOBIANS, FACTORISATIONS = range(7)
COUNTS = 7  # their number: length of `counts`


class Interval(NamedTuple):
    """A trial step, or a segment of a run, from `start` to `end` (s); no stage is evaluated later than `last`."""

    start: float
    end: float
    last: float


@helper
def copy(source, target):
    """target = source. A slice assignment would also compile its error message about shapes, which takes 3 s."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@helper
def all_finite(values):
    """Whether no component is NaN or infinite."""
    for value in values:  # noqa: SIM110 (a generator inside all() costs an allocation in compiled code)
        if not math.isfinite(value):
            return False
    return True


@written_out
def derivative(problem, t, y, dy, counts):
    """dy = f(t, y); returns a status code, which is not OK if the derivative is not finite."""
    counts[EVALUATIONS] += 1
    status = problem.rhs(t, y, dy, problem.constants, problem.workspace)
    if status == OK and not all_finite(dy):
        return NONFINITE
    return status


@helper
def linearisation(problem, t, y, J, counts):
    """J = df/dy (n,n) at (t, y); returns a status code, which is not OK if the Jacobian is not finite."""
    counts[JACOBIANS] += 1
    status = problem.jacobian(t, y, J, problem.exact, problem.tangent)
    if status == OK:
        for row in J:
            if not all_finite(row):
                return NONFINITE
    return status


@helper
def scaled_norm(values, y, accuracy):
    """Root mean square of values_i / (atol + rtol |y_i|) over the controlled components; 0 where there are none."""
    if accuracy.controlled == 0:
        return 0.0  # there are no degrees of freedom
    total = 0.0
    for i in range(accuracy.controlled):
        ratio = values[i] / (accuracy.atol + accuracy.rtol * abs(y[i]))
        total += ratio * ratio
    return math.sqrt(total / accuracy.controlled)


@helper
def shorter(error, exponent):
    """New step over old for an error norm of at least 1, the tolerance, of a method whose error is O(h^exponent)."""
    return max(SHRINK, SAFETY * error ** (-1.0 / exponent)) if math.isfinite(error) else SHRINK


@helper
def step_factor(error, error_before, exponent, rejected_before):
    """New step over old after an accepted step, from its error norm and that of the previous accepted step.

    Hairer, Norsett, Wanner II, IV.2: where stability bounds the step, control by the last error alone alternates
    between steps in which the fastest modes grow and rejections, and the growth is visible in loads. The step after a
    rejected one does not grow (I, II.4).
    """
    if error == 0.0:
        factor = GROW
    else:
        factor = SAFETY * error ** (0.2 * DAMPING - 1.0 / exponent) * max(error_before, CALM) ** DAMPING
    return min(1.0 if rejected_before else GROW, factor)


@helper
def initial_step(problem, segment, y, dy, accuracy, exponent, counts):
    """First step size: Hairer, Norsett, Wanner I, II.4. `dy` = f(t, y) at the segment's start."""
    trial, slope = np.empty(y.shape[0]), np.empty(y.shape[0])
    span = segment.end - segment.start
    d0 = scaled_norm(y, y, accuracy)
    d1 = scaled_norm(dy, y, accuracy)
    h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    h0 = min(h0, span)
    for i in range(y.shape[0]):
        trial[i] = y[i] + h0 * dy[i]
    if derivative(problem, min(segment.start + h0, segment.last), trial, slope, counts) != OK:
        return h0
    for i in range(y.shape[0]):
        slope[i] -= dy[i]
    d2 = scaled_norm(slope, y, accuracy) / h0
    h1 = max(1e-6, h0 * 1e-3) if d1 <= 1e-15 and d2 <= 1e-15 else (0.01 / max(d1, d2)) ** (1.0 / exponent)
    shortest = _ADVANCING * (np.nextafter(segment.start, math.inf) - segment.start)
    return min(max(min(100.0 * h0, h1), shortest), span)


@helper
def enter_segment(problem, segment, y, dy, h, accuracy, exponent, counts):
    """dy = f(t, y) at the start of a segment, where f may jump; returns (status code, h, or a first step if h = 0)."""
    status = derivative(problem, segment.start, y, dy, counts)
    if status == OK and h == 0.0:
        h = initial_step(problem, segment, y, dy, accuracy, exponent, counts)
    return status, h


@helper
def permitted(max_steps, counts):
    """OK if another step is permitted, otherwise the status code that says why not."""
    if counts[STOP] != 0:
        return INTERRUPTED
    return MAX_STEPS if counts[ACCEPTED] + counts[REJECTED] >= max_steps else OK


@helper
def step_end(t, h, end, trouble, max_steps, counts):
    """(status code, end of a step of size h). The status is OK, or says why there is no further step.

    Either there were too many steps, or this one is too short to advance time. Only a step to the end of a segment may
    be as short as the rounding of time. A step is extended by 1 % if it then reaches the end of the segment.
    """
    status, reaches = permitted(max_steps, counts), t + 1.01 * h >= end
    if status == OK and not reaches and h < 10.0 * (np.nextafter(t, math.inf) - t):
        status = trouble
    return status, end if reaches else t + h


@helper
def next_step(h, length, factor, cut):
    """Size of the step after an accepted one of this length. h was proposed for it; `cut`: it ends with its segment.

    A step that the end of its segment cut short does not reduce the size that was proposed.
    """
    return max(h, length * factor) if cut and factor >= 1.0 else length * factor


@helper
def retreat(status):
    """New step over old after a trial that failed before its error was estimated."""
    return HALVED if status == NOT_CONVERGED else RETREAT


@helper
def reason(status):
    """The status code if the step becomes too short: the failure that shortened it, else STEP_TOO_SMALL."""
    return STEP_TOO_SMALL if status in (OK, NOT_CONVERGED) else status


@helper
def stretch(t, sample, segment_end, step):
    """Equal steps from t to the next sample or segment end: (its time, their number, their size, last time before it).

    Stages at the end of a segment use the right-hand side's limit from the left, at the last of the returned times.
    """
    end = min(sample, segment_end)
    steps = max(1, math.ceil((end - t) / step * (1.0 - _STEP_SLACK)))
    return end, steps, (end - t) / steps, np.nextafter(segment_end, t)
