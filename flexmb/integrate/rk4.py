"""The classical Runge-Kutta method of order 4 with a fixed step, whole runs in one compiled loop."""

from __future__ import annotations

import numpy as np

from flexmb.integrate.control import ACCEPTED, SAMPLES, all_finite, begin, copy, derivative, permitted, stretch
from flexmb.integrate.integrator import Integrator
from flexmb.jit.kernel import kernel, written_out
from flexmb.tables.status import NONFINITE, OK


@written_out
def _stage(problem, t, y, slope, h, trial, dy, counts):
    """dy = f(t, y + h slope)."""
    for i in range(y.shape[0]):
        trial[i] = y[i] + h * slope[i]
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
    for i in range(y.shape[0]):
        trial[i] = y[i] + h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
    return OK if all_finite(trial) else NONFINITE


@kernel
def rk4(problem, y, clock, accuracy, out, counts):
    """Integrate y' = f(t, y) as told by `Integrator`.

    Every stretch between samples and segment ends is divided into equal steps not exceeding `accuracy.step`, and y is
    put back on its manifold after each.
    """
    times, segment_ends = clock
    k, trial = np.empty((4, y.shape[0])), np.empty(y.shape[0])
    t = times[0]
    begin(problem, t, y, out, counts)
    segment = 0
    for sample in range(1, times.shape[0]):
        while t < times[sample]:
            start = t
            end, steps, h, last = stretch(start, times[sample], segment_ends[segment], accuracy.step)
            for j in range(steps):
                status = permitted(accuracy.max_steps, counts)
                if status != OK:
                    return status, t
                status = rk4_step(problem, t, last, y, h, k, trial, counts)
                if status != OK:
                    return status, t
                t = end if j == steps - 1 else start + (j + 1) * h
                copy(trial, y)
                problem.project(t, y, problem.constants)
                counts[ACCEPTED] += 1
            if t == segment_ends[segment]:
                segment += 1
        copy(y, out[sample])
        counts[SAMPLES] = sample + 1
    return OK, t


INTEGRATOR = Integrator(
    "rk4", rk4, order=4, fixed=True, evaluations=4, summary="comparison with codes of fixed steps"
)
