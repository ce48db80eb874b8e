"""DOP853: Runge-Kutta of order 8 with error control and dense output of order 7.

Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), II.5 and II.10. After the stages of a step
follow the error test, the projection of the new state, and the derivative at the projected state. This derivative is
the first stage of the next step and enters the interpolant, so both are consistent with the projected state, and the
projection does not reduce the order.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.integrate.adaptive import adaptive, by_error
from flexmb.integrate.control import all_finite, derivative
from flexmb.integrate.dop853_formulas import (
    END,
    ERROR_EXPONENT,
    combine,
    error_norm,
    error_sums,
    interpolant,
    interpolate,
)
from flexmb.integrate.dop853_tableau import STAGES, STAGES_DENSE, A, C
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.watch import Ends
from flexmb.jit.kernel import handed_in, handed_on, helper, kernel
from flexmb.tables.status import NONFINITE, OK


class ExplicitStages(NamedTuple):
    """Slopes k (STAGES_DENSE,n) of a step, coefficients f (7,n) of its interpolant, whether these are known (1,)."""

    k: np.ndarray
    f: np.ndarray
    has_interpolant: np.ndarray


@helper
def stages(problem, step, y, k, trial, counts):
    """Stages 1 to 11 (stage 0 is given), then trial = y(step.end); a status code. No stage is after step.last."""
    h = step.end - step.start
    for s in range(1, STAGES + 1):
        combine(y, h, A[s], s, k, trial)
        if s == END:
            break
        status = derivative(problem, min(step.start + C[s] * h, step.last), trial, k[s], counts)
        if status != OK:
            return status
    return OK if all_finite(trial) else NONFINITE


@handed_in
def attempt(problem, step, ends, s, known, accuracy, counts):
    """See `Method`."""
    h = step.end - step.start
    s.has_interpolant[0] = 0
    status = stages(problem, step, ends.y, s.k, ends.y_new, counts)
    if status != OK:
        return status, (math.inf,)
    sum5, sum3 = error_sums(ends.y, ends.y_new, s.k, accuracy)
    error = error_norm(h, sum5, sum3, accuracy)
    if error < 1.0:
        problem.project(step.end, ends.y_new, problem.constants)
        status = derivative(problem, min(step.end, step.last), ends.y_new, ends.dy_new, counts)
    return status, (error,)


@handed_on
def state_at(problem, step, ends, s, t, result, run):
    """The state inside a step, projected, so that quaternions have unit norm and prescribed coordinates are exact.

    The interpolant takes three more stages, so it is computed on first use.
    """
    h = step.end - step.start
    if s.has_interpolant[0] == 0:
        for stage in range(STAGES + 1, STAGES_DENSE):
            combine(ends.y, h, A[stage], stage, s.k, result)
            status = derivative(problem, min(step.start + C[stage] * h, step.last), result, s.k[stage], run[1])
            if status != OK:
                return status
        interpolant(ends.y, ends.y_new, h, s.k, s.f)
        s.has_interpolant[0] = 1
    interpolate(ends.y, s.f, (t - step.start) / h, result)
    problem.project(t, result, problem.constants)
    return OK


@kernel
def dop853(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y' = f(t, y) as described in `Integrator`."""
    n = y.shape[0]
    s = ExplicitStages(np.empty((STAGES_DENSE, n)), np.empty((7, n)), np.zeros(1, np.int64))
    ends = Ends(y, s.k[0], np.empty(n), s.k[END])
    method = by_error(attempt, state_at, ERROR_EXPONENT)
    return adaptive(method, problem, (s, ends), clock, out, (accuracy, counts), memory, watch)


INTEGRATOR = Integrator(
    "dop853", dop853, order=8, evaluations=11,
    summary="the default: everything whose fastest mode matters, or is not a thousand times faster than what does",
)  # fmt: skip
