"""Common parts of all runs: derivatives that are checked, error scale, first step, change of step, stretches of steps.

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
# Share of the error before in the choice of a step, beta of Hairer, Norsett, Wanner II, IV.2.
DAMPING = 0.04
CALM = 1e-4  # the least error before that counts, and what stands for it where no step went before
RETREAT = 0.1  # change of step where the right-hand side could not be evaluated at all
HALVED = 0.5  # change of step where an iteration did not converge
# A fixed step may exceed the one asked for by this fraction: 0.1 s in steps of 0.01 s are 10, whatever 0.1/0.01 rounds
# to.
_STEP_SLACK = 1e-9
_ADVANCING = 1e3  # roundings of time: a first step is not shorter, whatever is guessed from a state at rest

# Entries of `counts`: evaluations, steps, samples stored, Jacobians, and factorisations or exponentials of a matrix.
# STOP is not a count: another thread sets it during a run, and the run then ends.
EVALUATIONS, ACCEPTED, REJECTED, SAMPLES, STOP, JACOBIANS, FACTORISATIONS = range(7)
COUNTS = 7  # their number: length of `counts`


class Interval(NamedTuple):
    """A trial step, or a segment of a run, from `start` to `end` (s); no stage is evaluated later than `last`."""

    start: float
    end: float
    last: float


@helper
def copy(source, target):
    """target = source. A slice assignment would compile a message about shapes as well: 3 s, most of the whole."""
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
    """dy = f(t, y); returns a status code, which is never OK for a derivative that is not finite."""
    counts[EVALUATIONS] += 1
    status = problem.rhs(t, y, dy, problem.constants, problem.workspace)
    if status == OK and not all_finite(dy):
        return NONFINITE
    return status


@helper
def scaled_norm(values, y, accuracy):
    """Root mean square of values_i / (atol + rtol |y_i|) over the controlled components; 0 where there are none."""
    if accuracy.controlled == 0:
        return 0.0  # nothing moves freely
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
    """New step over old after a step that was accepted, from its error norm and that of the one accepted before.

    Hairer, Norsett, Wanner II, IV.2: where stability bounds the step, a choice by the last error alone swings between
    steps that let the fastest modes grow and rejections; what they grow to is seen in loads. A step that follows a
    rejection does not grow (I, II.4).
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
    """dy = f(t, y), afresh, for it may jump where a segment ends; returns a status code, and h, the first one for 0."""
    status = derivative(problem, segment.start, y, dy, counts)
    if status == OK and h == 0.0:
        h = initial_step(problem, segment, y, dy, accuracy, exponent, counts)
    return status, h


@helper
def permitted(max_steps, counts):
    """OK where one more step may be made, or why not."""
    if counts[STOP] != 0:
        return INTERRUPTED
    return MAX_STEPS if counts[ACCEPTED] + counts[REJECTED] >= max_steps else OK


@helper
def step_end(t, h, end, trouble, max_steps, counts):
    """Where a step of size h ends, after a status code: OK, or why there is no further step.

    There may have been too many, or it is too short to advance time, unless it is to the end of a segment: that may be
    as short as the rounding of time. No sliver of a step is left before it.
    """
    status, reaches = permitted(max_steps, counts), t + 1.01 * h >= end
    if status == OK and not reaches and h < 10.0 * (np.nextafter(t, math.inf) - t):
        status = trouble
    return status, end if reaches else t + h


@helper
def next_step(h, length, factor, cut):
    """Step after one of this length that was accepted; h was proposed for it, `cut`: the segment's end cut it short.

    That says nothing against the longer one that was proposed.
    """
    return max(h, length * factor) if cut and factor >= 1.0 else length * factor


@helper
def retreat(status):
    """New step over old where a trial did not come to an error estimate."""
    return HALVED if status == NOT_CONVERGED else RETREAT


@helper
def reason(status):
    """What a step that gets too short reports: the failure that shortened it, or that steps do."""
    return STEP_TOO_SMALL if status in (OK, NOT_CONVERGED) else status


@helper
def stretch(t, sample, segment_end, step):
    """Equal steps from t to the next sample or segment end: (its time, their number, their size, last time before it).

    Stages at the end of a segment see the right-hand side's limit from the left, at the time returned last.
    """
    end = min(sample, segment_end)
    steps = max(1, math.ceil((end - t) / step * (1.0 - _STEP_SLACK)))
    return end, steps, (end - t) / steps, np.nextafter(segment_end, t)
