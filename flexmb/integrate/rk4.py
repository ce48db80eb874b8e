"""The classical Runge-Kutta method of order 4 with a fixed step, whole runs in one compiled loop."""

from __future__ import annotations

import math

import numpy as np

from flexmb.integrate.control import ACCEPTED, SAMPLES, all_finite, copy, derivative
from flexmb.kernel import generic
from flexmb.status import MAX_STEPS, NONFINITE, OK

# A step may exceed the one asked for by this fraction: 0.1 s in steps of 0.01 s are 10, whatever 0.1/0.01 rounds to.
_STEP_SLACK = 1e-9


@generic
def _stage(rhs, t, y, slope, h, trial, dy, constants, workspace, counts):
    """dy = f(t, y + h slope)."""
    for i in range(y.shape[0]):
        trial[i] = y[i] + h * slope[i]
    return derivative(rhs, t, trial, dy, constants, workspace, counts)


@generic
def rk4_step(rhs, t, last, y, h, k, trial, constants, workspace, counts):
    """trial = y(t + h) from y(t). `k` (4, n) is scratch; no stage is later than `last`. Returns a status code."""
    status = derivative(rhs, t, y, k[0], constants, workspace, counts)
    if status == OK:
        status = _stage(rhs, t + 0.5 * h, y, k[0], 0.5 * h, trial, k[1], constants, workspace, counts)
    if status == OK:
        status = _stage(rhs, t + 0.5 * h, y, k[1], 0.5 * h, trial, k[2], constants, workspace, counts)
    if status == OK:
        status = _stage(rhs, min(t + h, last), y, k[2], h, trial, k[3], constants, workspace, counts)
    if status != OK:
        return status
    for i in range(y.shape[0]):
        trial[i] = y[i] + h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
    return OK if all_finite(trial) else NONFINITE


@generic
def rk4(rhs, project, y, times, segment_ends, step, max_steps, constants, workspace, out, counts):
    """Integrate y' = rhs(t, y) from times[0] to times[-1] and store y at every time of `times` in `out`.

    y (n,): initial state, on return the last good one. times (T,) increasing. segment_ends: increasing, the last is
    times[-1]; no step crosses one, and the stages before one see the right-hand side's limit from the left. Every
    stretch between samples and segment ends is divided into equal steps not exceeding `step`.
    `project(t, y, constants)` puts y back on its manifold after each step. counts (4,): evaluations, accepted and
    rejected steps, samples stored. Returns (status code, time of the last good state).
    """
    n = y.shape[0]
    k = np.empty((4, n))
    trial = np.empty(n)
    t = times[0]
    project(t, y, constants)
    copy(y, out[0])
    counts[SAMPLES] = 1
    segment = 0
    for sample in range(1, times.shape[0]):
        while t < times[sample]:
            start, end = t, min(times[sample], segment_ends[segment])
            last = np.nextafter(segment_ends[segment], start)
            steps = max(1, math.ceil((end - start) / step * (1.0 - _STEP_SLACK)))
            h = (end - start) / steps
            for j in range(steps):
                if counts[ACCEPTED] >= max_steps:
                    return MAX_STEPS, t
                status = rk4_step(rhs, t, last, y, h, k, trial, constants, workspace, counts)
                if status != OK:
                    return status, t
                t = end if j == steps - 1 else start + (j + 1) * h
                copy(trial, y)
                project(t, y, constants)
                counts[ACCEPTED] += 1
            if t == segment_ends[segment]:
                segment += 1
        copy(y, out[sample])
        counts[SAMPLES] = sample + 1
    return OK, t
