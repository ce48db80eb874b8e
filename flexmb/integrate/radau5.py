"""Radau IIA of order 5 with error control and dense output.

Hairer, Wanner, Solving Ordinary Differential Equations II (1996), IV.8. L-stable: a mode that is too fast for the step
dies out instead of limiting it. The three stages come from simplified Newton iterations with one real and one complex
factorisation (`flexmb.integrate.radau5_stages`); Jacobian and factors are kept as long as they serve.
"""

from __future__ import annotations

import math

from flexmb.integrate.adaptive import Method, adaptive
from flexmb.integrate.control import SAFETY, SHRINK, copy, derivative, next_step, retreat, scaled_norm
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.memory import ERROR_BEFORE, FACTORED, FRESH, RENEW, RETRIED, STEP, STEP_BEFORE
from flexmb.integrate.radau5_stages import (
    ITERATIONS,
    REAL,
    E,
    evaluate_polynomial,
    factorise,
    guess,
    newton,
    renew,
    scratch,
    solve,
)
from flexmb.integrate.settling import settle
from flexmb.integrate.stiff_place import begin_without_jacobian, give_up, keep_place, recall_place, suffices
from flexmb.integrate.watch import Ends
from flexmb.jit.kernel import handed_in, handed_on, helper, kernel, sweep
from flexmb.tables.status import NOT_CONVERGED, OK

_GROW = 8.0  # strongest growth of a step
_KEEP = 1.2  # the step is kept for a growth below this, to avoid a new factorisation
_SAME = 1e-9  # relative difference of steps that share factors
_SLOW, _POOR = 1e-3, 0.03  # a contraction above this asks for a new Jacobian, after three iterations or more; after two
_INEXACT = 0.1  # the same for the stiff part in place of the Jacobian, which contracts no faster where it is new
_CONTRACTION = 0.15  # target contraction of Newton's method, where convergence limits the step
_CUT = 0.7  # upper bound of the factor on a step for which Newton's method failed
_FILTERED = 0.9  # an error that another filter reduces below this fraction is not that of rigid motion
_DIED_OUT = 0.5  # what then counts as its error, for the size of the next step
_ERROR_EXPONENT = 4.0  # the error estimate is O(h^4)


@helper
def estimate(problem, y, slope, h, s, accuracy):
    """Scaled norm of the embedded formula's error (8.19): the defect at the start, stiff parts filtered out."""
    for i in range(y.shape[0]):
        s.error[i] = slope[i] + (E[0] * s.Z[0, i] + E[1] * s.Z[1, i] + E[2] * s.Z[2, i]) / h
        s.trial[i] = max(abs(y[i]), abs(s.y_new[i]))
    solve(problem, s, h, s.error)
    return scaled_norm(s.error, s.trial, accuracy)


@sweep
def filtered(problem, y, h, s, accuracy):
    """Scaled norm of (1 - h J / REAL)^-1 times the last estimate.

    What a long step leaves of a stiff mode, a deflection d far below the tolerance, counts in (8.20) as a speed of
    about d/h: the more, the shorter a step is tried, until it resolves the ringing of frequency w that this amounts to.
    Here it counts (REAL / (h w))^2 times as much, so that steps which let it die out are accepted. What a step resolves
    is hardly changed.
    """
    for i in range(y.shape[0]):
        s.error[i] *= REAL / h
        s.trial[i] = max(abs(y[i]), abs(s.y_new[i]))
    solve(problem, s, h, s.error)
    return scaled_norm(s.error, s.trial, accuracy)


@helper
def new_over_old(h, h_before, error, error_before):
    """New step over old by Gustafsson's predictive controller (8.25), which extrapolates the trend of the error."""
    if error == 0.0:
        return _GROW
    factor = error ** (-1.0 / _ERROR_EXPONENT)
    if h_before > 0.0:
        factor *= min(1.0, h / h_before * (error_before / error) ** (1.0 / _ERROR_EXPONENT))
    return factor


@helper
def transient(problem, y, h, s, error, accuracy):
    """Whether the last estimate, of this norm, is that of a stiff transient which the step lets die out.

    It then falls if it is filtered again, and what it amounts to in displacements is far below the tolerance.
    """
    n, total = accuracy.coordinates, 0.0
    for i in range(n, accuracy.controlled):
        ratio = s.error[i] * h / (REAL * accuracy.atol)
        total += ratio * ratio
    small = total < accuracy.controlled - n
    return small and filtered(problem, y, h, s, accuracy) < _FILTERED * error


@sweep
def confirmed(problem, step, y, s, tried, error, accuracy, counts):
    """(Status code, error) of a step that this error would reject: see `try_step`. Few steps come here, so that its
    solutions of equations are not part of the loop over steps."""
    h = step.end - step.start
    for i in range(y.shape[0]):
        s.trial[i] = y[i] + s.error[i]
    status = derivative(problem, step.start, s.trial, s.f_new, counts)
    if status == OK:
        error = estimate(problem, y, s.f_new, h, s, accuracy)
    if status == OK and error >= 1.0:
        error = filtered(problem, y, h, s, accuracy)
    if status == OK and error >= max(1.0, tried) and transient(problem, y, h, s, error, accuracy):
        error = _DIED_OUT
    return status, error


@helper
def try_step(problem, step, ends, s, tried, accuracy, counts):
    """A step from a guess in Z: ends.y_new, projected, and its slope; a status code, and the verdict of `attempt`.

    tried: the error of a longer step from here that was rejected, inf where it had none, 0 without one. After one, a
    rejection is confirmed by the estimate (8.20), and by that `filtered`, which stiff transients spoil less. Errors of
    what is smooth fall with the step: if they have grown instead, and are those of a `transient`, the step is accepted.
    """
    y, h = ends.y, step.end - step.start
    status, iterations, rate = newton(problem, step, y, s, accuracy, counts)
    if status != OK:
        return status, (math.inf, iterations, rate)
    for i in range(y.shape[0]):
        s.y_new[i] = y[i] + s.Z[2, i]
    error = estimate(problem, y, s.f, h, s, accuracy)
    if error >= 1.0 and tried > 0.0:
        status, error = confirmed(problem, step, y, s, tried, error, accuracy, counts)
    if status == OK and error < 1.0:
        settle(problem, step.end, REAL / h, s.y_new, s, accuracy)
        status = derivative(problem, min(step.end, step.last), s.y_new, s.f_new, counts)
    return status, (error, iterations, rate)


@handed_in
def attempt(problem, step, ends, s, known, accuracy, counts):
    """See `flexmb.integrate.adaptive.Method`; verdict: error norm, iterations, contraction of Newton's method."""
    length, nothing = step.end - step.start, (math.inf, 0, 0.0)
    if known[RENEW] != 0.0:
        status = renew(problem, step.start, ends.y, s, counts)
        if status != OK:
            return status, nothing
        known[RENEW], known[FRESH], known[FACTORED] = 0.0, 1.0, 0.0
    # Equal steps differ by the rounding of time: the factors are good for all of them.
    if abs(length - known[FACTORED]) > _SAME * length:
        known[FACTORED] = length if factorise(problem, s, length, counts) else 0.0
    if known[FACTORED] == 0.0:
        return NOT_CONVERGED, nothing
    guess(s.Z_before, known[STEP_BEFORE], length, s.Z)
    tried = math.inf if known[STEP_BEFORE] == 0.0 and known[RETRIED] == 0.0 else known[RETRIED]
    return try_step(problem, step, ends, s, tried, accuracy, counts)


@handed_on
def state_at(problem, step, ends, s, t, result, run):
    """The state inside a step, by the collocation polynomial, projected; see `flexmb.integrate.watch`."""
    accuracy, _ = run
    evaluate_polynomial(s.Z, (t - step.start) / (step.end - step.start), result)
    for i in range(result.shape[0]):
        result[i] += ends.y[i]
    settle(problem, t, REAL / (step.end - step.start), result, s, accuracy)
    return OK


@handed_in
def keep(memory, s):
    """Store the Jacobian, or the place of the stiff part, and the stages of the step before."""
    n = s.f.shape[0]
    for i in range(n):
        copy(s.J[i], memory.rows[i])
    if suffices(s.stiff):
        keep_place(s.stiff, memory.rows)
    for stage in range(3):
        copy(s.Z_before[stage], memory.rows[n + stage])


@handed_in
def recall(problem, memory, s, known, counts):
    """Restore these for a resumed run and factorise again; in any other run the first step starts without them."""
    n = s.f.shape[0]
    if known[STEP_BEFORE] == 0.0 and known[FACTORED] == 0.0:
        known[ERROR_BEFORE], known[RENEW], known[FRESH] = 0.0, 1.0, 0.0
        return
    for i in range(n):
        copy(memory.rows[i], s.J[i])
    recall_place(problem, s.stiff, memory.rows)
    for stage in range(3):
        copy(memory.rows[n + stage], s.Z_before[stage])
    if known[FACTORED] > 0.0:
        factorise(problem, s, known[FACTORED], counts)


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
        return length * max(SHRINK, min(1.0, factor)), not fresh  # an old Jacobian filters the wrong directions
    if status == NOT_CONVERGED and not fresh:
        return length, True  # the Jacobian may be too old, not the step too long
    if status == NOT_CONVERGED and rate > 0.0:
        return length * max(SHRINK, min(_CUT, by_contraction(rate))), False
    return length * retreat(status), not fresh


@helper
def by_trend(length, verdict, known):
    """New step over old by the trend of errors, shorter the more iterations Newton's method took."""
    return caution(verdict) * new_over_old(length, known[STEP_BEFORE], verdict[0], known[ERROR_BEFORE])


@helper
def caution(verdict):
    """Factor on steps, the less the more iterations Newton's method took."""
    return SAFETY * (2.0 * ITERATIONS + 1.0) / (2.0 * ITERATIONS + verdict[1])


@helper
def by_error(verdict):
    """New step over old by the error alone, where a trial was rejected: that step ends no trend, and the errors of the
    trials may be those of stiff transients."""
    if verdict[0] == 0.0:
        return _GROW
    return caution(verdict) * verdict[0] ** (-1.0 / _ERROR_EXPONENT)


@handed_in
def accept(step, cut, verdict, s, known, exponent):
    """See `flexmb.integrate.adaptive.Method`."""
    length, (error, iterations, rate) = step.end - step.start, verdict
    worn = rate > (_INEXACT if suffices(s.stiff) else _SLOW if iterations > 2 else _POOR)
    by_errors = by_error(verdict) if known[RETRIED] != 0.0 else by_trend(length, verdict, known)
    factor = min(by_errors, by_contraction(rate))
    known[STEP] = after_acceptance(known[STEP], length, cut, factor, known[RETRIED] != 0.0, worn)
    known[STEP_BEFORE], known[ERROR_BEFORE] = length, max(1e-2, error)
    known[RENEW], known[FRESH], known[RETRIED] = 1.0 if worn else 0.0, 0.0, 0.0
    for stage in range(3):
        copy(s.Z[stage], s.Z_before[stage])


@handed_in
def reject(step, status, verdict, s, known, exponent):
    """See `flexmb.integrate.adaptive.Method`."""
    length, rate = step.end - step.start, verdict[2]
    factor = by_error(verdict) if status == OK else 1.0
    fresh = known[FRESH] != 0.0 and not (status == NOT_CONVERGED and give_up(s.stiff))
    known[STEP], renew = after_rejection(length, status, factor, rate, fresh)
    known[RENEW] = 1.0 if renew else 0.0
    if known[STEP] < length:
        known[RETRIED] = verdict[0] if status == OK else math.inf


@handed_in
def after_leap(length, cut, known, exponent):
    """See `flexmb.integrate.adaptive.Method`."""
    known[STEP] = length
    enter(known)


@handed_in
def enter(known):
    """Nothing is known across the end of a segment, or beyond a leap."""
    known[FACTORED], known[STEP_BEFORE], known[ERROR_BEFORE] = 0.0, 0.0, 0.0
    known[RENEW], known[FRESH], known[RETRIED] = 1.0, 0.0, 0.0


@kernel
def radau5(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y' = f(t, y) as told by `Integrator`; problem: a `StiffProblem`.

    Where Newton's method does not converge, an old Jacobian is renewed, then the step is shortened by how far it is
    from converging.
    """
    s = scratch(y.shape[0], accuracy.coordinates, accuracy.controlled - accuracy.coordinates)
    begin_without_jacobian(problem, s.stiff)
    ends = Ends(y, s.f, s.y_new, s.f_new)
    method = Method(attempt, accept, reject, after_leap, enter, recall, keep, state_at, _ERROR_EXPONENT)
    return adaptive(method, problem, (s, ends), clock, out, (accuracy, counts), memory, watch)


INTEGRATOR = Integrator(
    "radau5", radau5, order=5, linearises=True, keeps_jacobian=True, matrices=4,
    algebra=(10.0 / 24.0, 4.0),  # a real and a complex matrix of the speeds, half the state
    summary="modes or springs that are damped or hardly ring; moderate accuracy; the smallest cost of a step",
)  # fmt: skip
