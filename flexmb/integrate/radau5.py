"""Radau IIA of order 5 with error control and dense output, whole runs in one compiled loop.

Hairer, Wanner, Solving Ordinary Differential Equations II (1996), IV.8. L-stable: a mode that is too fast for the step
dies out instead of limiting it. The three stages come from simplified Newton iterations with one real and one complex
factorisation; Jacobian and factors are kept as long as they serve.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import (
    ACCEPTED,
    FACTORISATIONS,
    REJECTED,
    SAFETY,
    SAMPLES,
    SHRINK,
    Interval,
    copy,
    derivative,
    enter_segment,
    next_step,
    reason,
    retreat,
    scaled_norm,
    step_end,
)
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.jacobians import linearisation
from flexmb.integrate.leap import leap, may_leap, pause_in_leap, store_leapt
from flexmb.integrate.lu import lu_factorise, lu_solve
from flexmb.integrate.memory import ERROR_BEFORE, FACTORED, FRESH, RENEW, RETRIED, STEP, STEP_BEFORE, begin, keep
from flexmb.integrate.radau5_tableau import COMPLEX, REAL, V_COMPLEX, V_REAL, W_COMPLEX, W_REAL, C, E, P
from flexmb.integrate.settling import settle
from flexmb.integrate.watch import Ends, pause
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.status import NONFINITE, NOT_CONVERGED, OK, STEP_TOO_SMALL

_ITERATIONS = 7  # of Newton's method, at most
_GROW = 8.0  # strongest growth of a step
_KEEP = 1.2  # a growth below this is not worth new factors
_SAME = 1e-9  # relative difference of steps that share factors
_SLOW = 1e-3  # a contraction above this asks for a new Jacobian
_ERROR_EXPONENT = 4.0  # the error estimate is O(h^4)


class RadauStages(NamedTuple):
    """Arrays of a step: slope f at its start; stages Z, those of the step before, slopes F (3,n); factors; unknowns w,
    v and corrections dw, dv, decoupled.
    """

    f: np.ndarray
    J: np.ndarray
    real: np.ndarray
    paired: np.ndarray
    real_pivots: np.ndarray
    paired_pivots: np.ndarray
    Z: np.ndarray
    Z_before: np.ndarray
    F: np.ndarray
    w: np.ndarray
    v: np.ndarray
    dw: np.ndarray
    dv: np.ndarray
    y_new: np.ndarray
    f_new: np.ndarray
    error: np.ndarray
    trial: np.ndarray
    change: np.ndarray


@helper
def factorise(s, h, counts):
    """Factors of REAL/h - J and COMPLEX/h - J; returns whether both are regular."""
    n = s.J.shape[0]
    for i in range(n):
        for j in range(n):
            s.real[i, j] = -s.J[i, j]
            s.paired[i, j] = -s.J[i, j]
        s.real[i, i] += REAL / h
        s.paired[i, i] += COMPLEX / h
    counts[FACTORISATIONS] += 1
    return lu_factorise(s.real, s.real_pivots) and lu_factorise(s.paired, s.paired_pivots)


@helper
def evaluate_polynomial(Z, x, result):
    """result (n,) = collocation polynomial at the fraction x of the step, less the state at its start."""
    for i in range(result.shape[0]):
        value = 0.0
        for k in range(2, -1, -1):
            value = (value + P[0, k] * Z[0, i] + P[1, k] * Z[1, i] + P[2, k] * Z[2, i]) * x
        result[i] = value


@helper
def correct(s, h):
    """One Newton correction (dw real, dv complex) of the decoupled stages (w, v)."""
    F = s.F
    for i in range(s.w.shape[0]):
        s.dw[i] = W_REAL[0] * F[0, i] + W_REAL[1] * F[1, i] + W_REAL[2] * F[2, i] - REAL / h * s.w[i]
        s.dv[i] = W_COMPLEX[0] * F[0, i] + W_COMPLEX[1] * F[1, i] + W_COMPLEX[2] * F[2, i] - COMPLEX / h * s.v[i]
    lu_solve(s.real, s.real_pivots, s.dw)
    lu_solve(s.paired, s.paired_pivots, s.dv)
    for i in range(s.w.shape[0]):
        s.w[i] += s.dw[i]
        s.v[i] += s.dv[i]


@helper
def to_stages(w, v, Z):
    """Z (3,n) from its decoupled form."""
    for s in range(3):
        for i in range(w.shape[0]):
            Z[s, i] = V_REAL[s] * w[i] + 2.0 * (V_COMPLEX[s] * v[i]).real


@helper
def to_decoupled(Z, w, v):
    """The decoupled form of Z (3,n)."""
    for i in range(w.shape[0]):
        w[i] = W_REAL[0] * Z[0, i] + W_REAL[1] * Z[1, i] + W_REAL[2] * Z[2, i]
        v[i] = W_COMPLEX[0] * Z[0, i] + W_COMPLEX[1] * Z[1, i] + W_COMPLEX[2] * Z[2, i]


@helper
def stage_norm(dZ, y, accuracy):
    """Root mean square of the scaled norms of three stages (3,n)."""
    total = 0.0
    for s in range(3):
        total += scaled_norm(dZ[s], y, accuracy) ** 2
    return math.sqrt(total / 3.0)


@helper
def newton(problem, step, y, s, accuracy, counts):
    """Solve for the stages Z, which hold a first guess. Returns (status, iterations, last contraction).

    Ends where the next correction would be below a fraction of the tolerance, with NOT_CONVERGED where it would not get
    there in time.
    """
    h = step.end - step.start
    tolerance = max(10.0 * 2.0**-52 / accuracy.rtol, min(0.03, math.sqrt(accuracy.rtol)))
    to_decoupled(s.Z, s.w, s.v)
    rate, before = 0.0, 0.0
    for iteration in range(1, _ITERATIONS + 1):
        for stage in range(3):
            for i in range(y.shape[0]):
                s.trial[i] = y[i] + s.Z[stage, i]
            status = derivative(problem, min(step.start + C[stage] * h, step.last), s.trial, s.F[stage], counts)
            if status != OK:
                return status, iteration, rate
        correct(s, h)
        to_stages(s.dw, s.dv, s.F)
        size = stage_norm(s.F, y, accuracy)
        to_stages(s.w, s.v, s.Z)
        if not math.isfinite(size):
            return NONFINITE, iteration, rate
        if iteration > 1:
            rate = size / before
            if rate >= 1.0 or rate ** (_ITERATIONS - iteration) / (1.0 - rate) * size > tolerance:
                return NOT_CONVERGED, iteration, rate
        if size == 0.0 or (iteration > 1 and rate / (1.0 - rate) * size < tolerance):
            return OK, iteration, rate
        before = size
    return NOT_CONVERGED, _ITERATIONS, rate


@helper
def estimate(y, slope, h, s, accuracy):
    """Scaled norm of the embedded formula's error (8.19): the defect at the start, stiff parts filtered out."""
    for i in range(y.shape[0]):
        s.error[i] = slope[i] + (E[0] * s.Z[0, i] + E[1] * s.Z[1, i] + E[2] * s.Z[2, i]) / h
        s.trial[i] = max(abs(y[i]), abs(s.y_new[i]))
    lu_solve(s.real, s.real_pivots, s.error)
    return scaled_norm(s.error, s.trial, accuracy)


@helper
def new_over_old(h, h_before, error, error_before):
    """Step size by the controller of Gustafsson (8.25): the error's trend is taken to go on."""
    if error == 0.0:
        return _GROW
    factor = error ** (-1.0 / _ERROR_EXPONENT)
    if h_before > 0.0:
        factor *= min(1.0, h / h_before * (error_before / error) ** (1.0 / _ERROR_EXPONENT))
    return factor


@helper
def guess(before, h_before, h, Z):
    """First guess of the stages: the polynomial of the step before, continued; zero without one."""
    for stage in range(3):
        if h_before > 0.0:
            evaluate_polynomial(before, 1.0 + C[stage] * h / h_before, Z[stage])
        for i in range(Z.shape[1]):
            Z[stage, i] = Z[stage, i] - before[2, i] if h_before > 0.0 else 0.0


@helper
def attempt(problem, step, y, s, filter_again, accuracy, counts):
    """One trial step from a guess in Z: y_new, projected, and its slope f_new; returns status, error norm, iterations,
    contraction. `filter_again`: a rejection is confirmed by the estimate (8.20), which no stiff transient can spoil.
    """
    h = step.end - step.start
    status, iterations, rate = newton(problem, step, y, s, accuracy, counts)
    if status != OK:
        return status, math.inf, iterations, rate
    for i in range(y.shape[0]):
        s.y_new[i] = y[i] + s.Z[2, i]
    error = estimate(y, s.f, h, s, accuracy)
    if error >= 1.0 and filter_again:
        for i in range(y.shape[0]):
            s.trial[i] = y[i] + s.error[i]
        status = derivative(problem, step.start, s.trial, s.f_new, counts)
        if status == OK:
            error = estimate(y, s.f_new, h, s, accuracy)
    if status == OK and error < 1.0:
        settle(problem, step.end, REAL / h, s.y_new, s, accuracy)
        status = derivative(problem, min(step.end, step.last), s.y_new, s.f_new, counts)
    return status, error, iterations, rate


@helper
def state_at(problem, step, y, s, t, accuracy, result):
    """The state inside a step, by the collocation polynomial, projected."""
    evaluate_polynomial(s.Z, (t - step.start) / (step.end - step.start), result)
    for i in range(y.shape[0]):
        result[i] += y[i]
    settle(problem, t, REAL / (step.end - step.start), result, s, accuracy)


@helper
def inside(problem, step, ends, s, t, result, run):
    """The same as `flexmb.integrate.watch` asks for it."""
    accuracy, _ = run
    state_at(problem, step, ends.y, s, t, accuracy, result)
    return OK


@helper
def store_samples(problem, step, y, s, samples, accuracy, counts):
    """Store the samples in the step, its end included; samples: (times, states)."""
    times, out = samples
    sample = counts[SAMPLES]
    while sample < times.shape[0] and times[sample] <= step.end:
        if times[sample] == step.end:
            copy(s.y_new, out[sample])
        else:
            state_at(problem, step, y, s, times[sample], accuracy, out[sample])
        sample += 1
    counts[SAMPLES] = sample


@helper
def keep_stages(memory, s, h_factored, h_before, renew, fresh):
    """What only this method knows before a step: Jacobian, stages of the step before."""
    numbers, n = memory.numbers, s.f.shape[0]
    numbers[FACTORED], numbers[STEP_BEFORE] = h_factored, h_before
    numbers[RENEW], numbers[FRESH] = 1.0 if renew else 0.0, 1.0 if fresh else 0.0
    for i in range(n):
        copy(s.J[i], memory.rows[i])
    for stage in range(3):
        copy(s.Z_before[stage], memory.rows[n + stage])


@helper
def recall(memory, s, counts):
    """The same of a run that is taken up, with factors made again; of another one that there is nothing.

    Returns (step of the factors, step and error norm before, whether to renew the Jacobian, whether it is of this
    place, whether the step before was rejected).
    """
    numbers, n = memory.numbers, s.f.shape[0]
    h_factored = numbers[FACTORED]
    if numbers[STEP_BEFORE] == 0.0 and h_factored == 0.0:
        return 0.0, 0.0, 0.0, True, False, numbers[RETRIED] != 0.0
    for i in range(n):
        copy(memory.rows[i], s.J[i])
    for stage in range(3):
        copy(memory.rows[n + stage], s.Z_before[stage])
    if h_factored > 0.0:
        factorise(s, h_factored, counts)
    return (
        h_factored, numbers[STEP_BEFORE], numbers[ERROR_BEFORE], numbers[RENEW] != 0.0, numbers[FRESH] != 0.0,
        numbers[RETRIED] != 0.0,
    )  # fmt: skip


@helper
def scratch(n):
    """For n components."""
    return RadauStages(
        np.empty(n), np.empty((n, n)), np.empty((n, n)), np.empty((n, n), np.complex128), np.empty(n, np.int64),
        np.empty(n, np.int64), np.empty((3, n)), np.empty((3, n)), np.empty((3, n)), np.empty(n),
        np.empty(n, np.complex128), np.empty(n), np.empty(n, np.complex128), np.empty(n), np.empty(n), np.empty(n),
        np.empty(n), np.empty(n),
    )  # fmt: skip


@helper
def after_acceptance(h, length, cut, factor, rejected, worn):
    """Step after one of this length: a change that is not worth new factors is none, unless they are `worn` anyway."""
    factor = min(1.0, factor) if rejected else min(_GROW, factor)
    return next_step(h, length, 1.0 if 1.0 <= factor < _KEEP and not worn else factor, cut)


@kernel
def radau5(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y' = f(t, y) as told by `Integrator`; problem: a `StiffProblem`.

    The retreat from a failing right-hand side is that of `dop853`, and so are leaps. Where Newton's method does not
    converge, an old Jacobian is renewed, then the step is halved.
    """
    times, segment_ends = clock
    s = scratch(y.shape[0])
    t = begin(problem, times, y, s.y_new, memory, out, counts)
    h, kept = memory.numbers[STEP], False
    h_factored, h_before, error_before, renew, fresh, rejected = recall(memory, s, counts)
    trouble = STEP_TOO_SMALL
    for i in range(segment_ends.shape[0]):
        end, is_last = segment_ends[i], i + 1 == segment_ends.shape[0]
        last = np.nextafter(end, t)
        status, h = enter_segment(problem, Interval(t, end, last), y, s.f, h, accuracy, _ERROR_EXPONENT, counts)
        if status != OK:
            return status, t
        while t < end:
            status, t_new = step_end(t, h, end, trouble, accuracy.max_steps, counts)
            if not kept and (status != OK or (is_last and t_new == end)):
                keep(memory, t, y, h, error_before, rejected, counts)
                keep_stages(memory, s, h_factored, h_before, renew, fresh)
                kept = True
            if status != OK:
                return status, t
            step, length = Interval(t, t_new, last), t_new - t
            if renew:
                status = linearisation(problem, t, y, s.J, counts)
                if status != OK:
                    return status, t
                renew, fresh, h_factored = False, True, 0.0
            # Equal steps differ by the rounding of time: the factors are good for all of them.
            if abs(length - h_factored) > _SAME * length:
                h_factored = length if factorise(s, length, counts) else 0.0
            status, error, iterations, rate = NOT_CONVERGED, math.inf, 0, 0.0
            if h_factored > 0.0:
                guess(s.Z_before, h_before, length, s.Z)
                status, error, iterations, rate = attempt(
                    problem, step, y, s, rejected or h_before == 0.0, accuracy, counts
                )
            trouble = reason(status)
            if may_leap(status):
                far = leap(problem, last, y, s.f, s.y_new, s.f_new, counts)
                if far > 0.0:
                    step = Interval(t, t + far, last)
                    if watch is not None:
                        ends, samples, run = Ends(y, s.f, s.y_new, s.f_new), (times, out), (accuracy, counts)
                        status, t_at = pause_in_leap(problem, watch, step, ends, samples, run)
                        if status != OK:
                            return status, t_at
                    store_leapt(step, y, s.f, s.y_new, s.f_new, times, out, counts)
                    # beyond it everything begins anew
                    t, h, h_factored, h_before, error_before = t + far, far, 0.0, 0.0, 0.0
                    renew, fresh, rejected = True, False, False
                    copy(s.y_new, y)
                    copy(s.f_new, s.f)
                    counts[ACCEPTED] += 1
                    continue
            factor = 1.0
            if status == OK:
                caution = SAFETY * (2.0 * _ITERATIONS + 1.0) / (2.0 * _ITERATIONS + iterations)
                factor = caution * new_over_old(length, h_before, error, error_before)
            if status == OK and error < 1.0:
                if watch is not None:
                    ends, samples, run = Ends(y, s.f, s.y_new, s.f_new), (times, out), (accuracy, counts)
                    status, t_at = pause(problem, watch, step, ends, inside, s, samples, run)
                    if status != OK:
                        return status, t_at
                store_samples(problem, step, y, s, (times, out), accuracy, counts)
                renew = iterations > 2 and rate > _SLOW
                h = after_acceptance(h, length, t_new == end, factor, rejected, renew)
                t, h_before, error_before = t_new, length, max(1e-2, error)
                copy(s.y_new, y)
                copy(s.f_new, s.f)
                for stage in range(3):
                    copy(s.Z[stage], s.Z_before[stage])
                counts[ACCEPTED] += 1
                fresh, rejected = False, False
            else:
                if status == OK:
                    h = length * max(SHRINK, min(1.0, factor))
                elif status == NOT_CONVERGED and not fresh:
                    h, renew = length, True  # the Jacobian may be too old, not the step too long
                else:
                    h, renew = length * retreat(status), not fresh
                counts[REJECTED] += 1
                rejected = True
        h_factored, h_before, error_before = 0.0, 0.0, 0.0  # nothing is known across a segment's end
        renew, fresh, rejected, trouble = True, False, False, STEP_TOO_SMALL
    if not kept:
        keep(memory, t, y, h, error_before, rejected, counts)
        keep_stages(memory, s, h_factored, h_before, renew, fresh)
    return OK, t


INTEGRATOR = Integrator(
    "radau5", radau5, order=5, linearises=True, keeps_jacobian=True,
    algebra=(10.0 / 3.0, 10.0),  # a real and a complex matrix
    summary="modes or springs that are damped or hardly ring; moderate accuracy; the smallest cost of a step",
)  # fmt: skip
