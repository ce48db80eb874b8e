"""Radau IIA of order 5 with error control and dense output, whole runs in one compiled loop.

Hairer, Wanner, Solving Ordinary Differential Equations II (1996), IV.8. L-stable: a mode that is too fast for the step
dies out instead of limiting it. The three stages come from simplified Newton iterations with one real and one complex
factorisation (`flexmb.integrate.radau5_stages`); Jacobian and factors are kept as long as they serve.
"""

from __future__ import annotations

import math

import numpy as np

from flexmb.integrate.control import (
    ACCEPTED,
    REJECTED,
    SAFETY,
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
from flexmb.integrate.dense_output import store_samples
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.jacobians import linearisation
from flexmb.integrate.leap import leap, may_leap, pause_in_leap, store_leapt
from flexmb.integrate.lu import lu_solve
from flexmb.integrate.memory import ERROR_BEFORE, FACTORED, FRESH, RENEW, RETRIED, STEP, STEP_BEFORE, begin, keep
from flexmb.integrate.radau5_stages import ITERATIONS, evaluate_polynomial, factorise, guess, newton, scratch
from flexmb.integrate.radau5_tableau import REAL, E
from flexmb.integrate.settling import settle
from flexmb.integrate.watch import Ends, keep_sides, pause
from flexmb.jit.kernel import handed_on, helper, kernel
from flexmb.tables.status import NOT_CONVERGED, OK, STEP_TOO_SMALL

_GROW = 8.0  # strongest growth of a step
_KEEP = 1.2  # a growth below this is not worth new factors
_SAME = 1e-9  # relative difference of steps that share factors
_SLOW, _POOR = 1e-3, 0.03  # a contraction above this asks for a new Jacobian, after three iterations or more; after two
_CONTRACTION = 0.15  # of Newton's method, which steps aim at where it bounds them
_CUT = 0.7  # a step for which it failed becomes shorter by this at least
_ERROR_EXPONENT = 4.0  # the error estimate is O(h^4)


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


@handed_on
def state_at(problem, step, ends, s, t, result, run):
    """The state inside a step, by the collocation polynomial, projected; see `flexmb.integrate.watch`."""
    accuracy, _ = run
    evaluate_polynomial(s.Z, (t - step.start) / (step.end - step.start), result)
    for i in range(result.shape[0]):
        result[i] += ends.y[i]
    settle(problem, t, REAL / (step.end - step.start), result, s, accuracy)
    return OK


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
def by_contraction(rate):
    """New step over old that brings the contraction of Newton's method to what steps aim at.

    Where stiff forces turn with the motion, as in closed chains, they turn within a step as well, which the Jacobian of
    its start does not know. That bounds the step, where errors alone would ask for one that fails.
    """
    return math.sqrt(_CONTRACTION / rate) if rate > 0.0 else _GROW


@helper
def after_acceptance(h, length, cut, factor, rejected, worn):
    """Step after one of this length: a change that is not worth new factors is none, unless they are `worn` anyway."""
    factor = min(1.0, factor) if rejected else min(_GROW, factor)
    return next_step(h, length, 1.0 if 1.0 <= factor < _KEEP and not worn else factor, cut)


@helper
def after_rejection(length, status, factor, rate, fresh):
    """(Step, whether with a new Jacobian) after a trial of this length that was not accepted."""
    if status == OK:
        return length * max(SHRINK, min(1.0, factor)), False
    if status == NOT_CONVERGED and not fresh:
        return length, True  # the Jacobian may be too old, not the step too long
    if status == NOT_CONVERGED and rate > 0.0:
        return length * max(SHRINK, min(_CUT, by_contraction(rate))), False
    return length * retreat(status), not fresh


@helper
def leap_over(problem, watch, t, last, ends, samples, run):
    """The place at t where steps fail is passed, and sampled: (OK, the time beyond it), or t where it cannot be yet.

    What ends the run there is returned with its time.
    """
    _, counts = run
    far = leap(problem, last, ends.y, ends.dy, ends.y_new, ends.dy_new, counts)
    if far > 0.0:
        step = Interval(t, t + far, last)
        if watch is not None:
            status, t_at = pause_in_leap(problem, watch, step, ends, samples, run)
            if status != OK:
                return status, t_at
        store_leapt(step, ends.y, ends.dy, ends.y_new, ends.dy_new, samples[0], samples[1], counts)
        copy(ends.y_new, ends.y)
        copy(ends.dy_new, ends.dy)
        counts[ACCEPTED] += 1
    return OK, t + far


@kernel
def radau5(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y' = f(t, y) as told by `Integrator`; problem: a `StiffProblem`.

    The retreat from a failing right-hand side is that of `dop853`, and so are leaps. Where Newton's method does not
    converge, an old Jacobian is renewed, then the step is shortened by how far it is from converging.
    """
    times, segment_ends = clock
    s = scratch(y.shape[0])
    ends, samples, run = Ends(y, s.f, s.y_new, s.f_new), (times, out), (accuracy, counts)
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
                if watch is not None:
                    keep_sides(watch)
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
                passed, t_at = leap_over(problem, watch, t, last, ends, samples, run)
                if passed != OK:
                    return passed, t_at
                if t_at > t:  # beyond it everything begins anew
                    t, h, h_factored, h_before, error_before = t_at, t_at - t, 0.0, 0.0, 0.0
                    renew, fresh, rejected = True, False, False
                    continue
            factor = 1.0
            if status == OK:
                caution = SAFETY * (2.0 * ITERATIONS + 1.0) / (2.0 * ITERATIONS + iterations)
                factor = caution * new_over_old(length, h_before, error, error_before)
            if status == OK and error < 1.0:
                if watch is not None:
                    status, t_at = pause(problem, watch, step, ends, state_at, s, samples, run)
                    if status != OK:
                        return status, t_at
                store_samples(problem, step, ends, state_at, s, samples, run)
                renew = rate > (_SLOW if iterations > 2 else _POOR)
                factor = min(factor, by_contraction(rate))
                h = after_acceptance(h, length, t_new == end, factor, rejected, renew)
                t, h_before, error_before = t_new, length, max(1e-2, error)
                copy(s.y_new, y)
                copy(s.f_new, s.f)
                for stage in range(3):
                    copy(s.Z[stage], s.Z_before[stage])
                counts[ACCEPTED] += 1
                fresh, rejected = False, False
            else:
                h, renew = after_rejection(length, status, factor, rate, fresh)
                counts[REJECTED] += 1
                rejected = rejected or h < length
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
