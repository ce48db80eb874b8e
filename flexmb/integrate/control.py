"""One step control for all adaptive methods: error scale, change of step, first step, and what is checked on the way.

The last components of a state y (n,) may be pure quadratures: only the first `controlled` ones enter a norm (see
`dop853`).
"""

from __future__ import annotations

import math

from flexmb.kernel import generic, helper
from flexmb.status import NONFINITE, OK

SAFETY = 0.9
SHRINK = 0.2  # strongest change of step after a rejection ...
GROW = 10.0  # ... and after an acceptance
RETREAT = 0.1  # change of step where the right-hand side could not be evaluated at all

EVALUATIONS, ACCEPTED, REJECTED, SAMPLES = range(4)  # entries of `counts`


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


@generic
def derivative(rhs, t, y, dy, constants, workspace, counts):
    """dy = f(t, y); returns a status code, which is never OK for a derivative that is not finite."""
    counts[EVALUATIONS] += 1
    status = rhs(t, y, dy, constants, workspace)
    if status == OK and not all_finite(dy):
        return NONFINITE
    return status


@helper
def scaled_norm(values, y, rtol, atol, controlled):
    """Root mean square of values_i / (atol + rtol |y_i|) over the controlled components; 0 where there are none."""
    if controlled == 0:
        return 0.0  # nothing moves freely
    total = 0.0
    for i in range(controlled):
        ratio = values[i] / (atol + rtol * abs(y[i]))
        total += ratio * ratio
    return math.sqrt(total / controlled)


@helper
def step_factor(error, exponent, rejected_before):
    """New step over old for an error norm (1 is the tolerance) of a method whose error is O(h^exponent).

    A step that follows a rejection does not grow: Hairer, Norsett, Wanner I, II.4.
    """
    if not math.isfinite(error):
        return SHRINK
    if error >= 1.0:
        return max(SHRINK, SAFETY * error ** (-1.0 / exponent))
    factor = GROW if error == 0.0 else min(GROW, SAFETY * error ** (-1.0 / exponent))
    return min(1.0, factor) if rejected_before else factor


@generic
def initial_step(
    rhs, t, y, dy, span, last, rtol, atol, controlled, exponent, constants, workspace, counts, trial, slope
):
    """First step size: Hairer, Norsett, Wanner I, II.4. `dy` = f(t, y); `trial` and `slope` (n,) are scratch."""
    d0 = scaled_norm(y, y, rtol, atol, controlled)
    d1 = scaled_norm(dy, y, rtol, atol, controlled)
    h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    h0 = min(h0, span)
    for i in range(y.shape[0]):
        trial[i] = y[i] + h0 * dy[i]
    if derivative(rhs, min(t + h0, last), trial, slope, constants, workspace, counts) != OK:
        return h0
    for i in range(y.shape[0]):
        slope[i] -= dy[i]
    d2 = scaled_norm(slope, y, rtol, atol, controlled) / h0
    h1 = max(1e-6, h0 * 1e-3) if d1 <= 1e-15 and d2 <= 1e-15 else (0.01 / max(d1, d2)) ** (1.0 / exponent)
    return min(100.0 * h0, h1, span)
