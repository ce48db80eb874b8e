"""The generalised-alpha method with a fixed step, also on Lie groups.

Chung, Hulbert, J. Appl. Mech. 60 (1993), 371; on Lie groups Bruels, Cardona, J. Comput. Nonlinear Dyn. 5 (2010),
031002, here for explicit equations of motion, udot = f(t, q, u):

    q_1 = q_0 o exp(h u_0 + h^2 ((1/2 - beta) a_0 + beta a_1)),     u_1 = u_0 + h ((1 - gamma) a_0 + gamma a_1),
    (1 - alpha_m) a_1 + alpha_m a_0 = (1 - alpha_f) udot_1 + alpha_f udot_0.

What is added up here is resolved in the axes of increments, `StiffProblem.resolve`: velocities of free hinges in those
of the inboard body. In axes that turn with the body, u_1 would have the error of a rotation, and the linear momentum of
a body that nothing pushes would turn. The order is 2; the parameter is the spectral radius at infinite frequency: 1
damps nothing, 0 removes in one step all modes that the step does not resolve.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import FACTORISATIONS, Interval, all_finite, copy, derivative, linearisation, scaled_norm
from flexmb.integrate.equal_steps import FixedMethod, equal_steps
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.lu import lu_factorise, lu_solve
from flexmb.integrate.memory import FACTORED, FRESH, TAKEN_UP
from flexmb.integrate.newton_matrix import RateBlocks, find_blocks, rate_blocks
from flexmb.integrate.stiff_place import (
    StiffPlace,
    begin_without_jacobian,
    filtered,
    give_up,
    keep_place,
    pulled_back,
    recall_place,
    settle_at,
    shift,
    stiff_place,
    suffices,
)
from flexmb.integrate.watch import Ends
from flexmb.jit.kernel import handed_in, handed_on, helper, kernel, sweep
from flexmb.tables.axes import FIXED, RATES, TURNING
from flexmb.tables.status import NONFINITE, NOT_CONVERGED, OK, OUT_OF_RANGE

_ITERATIONS = 12  # maximum number of Newton iterations
_INEXACT = 30  # the same without the Jacobian, whose cost is that of many iterations
_ROUNDING = 2.0**-46  # relative size of corrections that count as rounding of accelerations: 64 ulp
_WORN = 8  # number of iterations from which the Jacobian is renewed; fewer cost less than a new Jacobian
_SAME = 1e-9  # relative difference of steps that share factors


class NewmarkArrays(NamedTuple):
    """Arrays of a step: J (n,n); matrix of Newton's method (nu,nu); speeds at the start, a and udot at both ends (nu,),
    all in the axes of increments; slopes (n,)."""

    J: np.ndarray
    matrix: np.ndarray
    pivots: np.ndarray
    blocks: RateBlocks
    begun: np.ndarray
    a: np.ndarray
    a_new: np.ndarray
    rate: np.ndarray
    rate_new: np.ndarray
    increment: np.ndarray
    correction: np.ndarray
    f: np.ndarray
    f_new: np.ndarray
    y_new: np.ndarray
    y_before: np.ndarray
    stiff: StiffPlace


@helper
def parameters(radius):
    """alpha_m, alpha_f, beta, gamma of the spectral radius at infinity."""
    alpha_m = (2.0 * radius - 1.0) / (radius + 1.0)
    alpha_f = radius / (radius + 1.0)
    return alpha_m, alpha_f, 0.25 * (1.0 - alpha_m + alpha_f) ** 2, 0.5 - alpha_m + alpha_f


@helper
def largest(values):
    """The largest magnitude of the values."""
    size = 0.0
    for value in values:
        size = max(size, abs(value))
    return size


@helper
def shifts(h, radius):
    """a and b of the matrix of Newton's method, 1 - a J_u - b J_q N."""
    alpha_m, alpha_f, beta, gamma = parameters(radius)
    weight = (1.0 - alpha_f) / (1.0 - alpha_m)
    return weight * h * gamma, weight * h * h * beta


@helper
def factorise(problem, s, h, accuracy, counts):
    """Factors of d(udot_1 - f)/d(udot_1); dq/du is the block of J that maps speeds to rates of coordinates."""
    a, b = shifts(h, accuracy.radius)
    if suffices(s.stiff):
        counts[FACTORISATIONS] += 1
        return shift(problem, a, b, 0)
    nq, nu = accuracy.coordinates, s.matrix.shape[0]
    find_blocks(s.blocks, s.J, nq)
    for i in range(nu):
        row, given = s.matrix[i], s.J[nq + i]
        for j in range(nu):
            row[j] = -a * given[nq + j]
        _add_motion(s, given, -b, row)
        row[i] += 1.0
    counts[FACTORISATIONS] += 1
    return lu_factorise(s.matrix, s.pivots)


@helper
def _add_motion(s, given, factor, row):
    """row (nu,) += factor d(udot_i)/dq dq/du, for a row `given` of J; of dq/du only the blocks that are not zero."""
    b, nu = s.blocks, row.shape[0]
    nq = b.start.shape[0]
    for place in range(b.count[0]):
        start, stop, first, last = b.start[place], b.stop[place], b.first[place], min(b.last[place], nu)
        if b.single[place] == 1:
            for k in range(last - first):
                row[first + k] += factor * given[start + k] * s.J[start + k, nq + first + k]
        else:
            for k in range(start, stop):
                for j in range(first, last):
                    row[j] += factor * given[k] * s.J[k, nq + j]


@helper
def end_of_step(problem, y, h, s, accuracy):
    """y_new and a_new from udot at both ends; components after the speeds are not changed."""
    alpha_m, alpha_f, beta, gamma = parameters(accuracy.radius)
    nq, speeds = accuracy.coordinates, speeds_of(s.y_new, s, accuracy)
    for j in range(s.a.shape[0]):
        a = ((1.0 - alpha_f) * s.rate_new[j] + alpha_f * s.rate[j] - alpha_m * s.a[j]) / (1.0 - alpha_m)
        s.a_new[j] = a
        s.increment[j] = h * (s.begun[j] + h * ((0.5 - beta) * s.a[j] + beta * a))
        s.y_new[nq + j] = s.begun[j] + h * ((1.0 - gamma) * s.a[j] + gamma * a)
    problem.move(y, s.increment, s.y_new, problem.constants)
    problem.resolve(s.y_new, speeds, speeds, TURNING, problem.constants)


@helper
def speeds_of(y, s, accuracy):
    """The speeds (nu,) of a state, which are a part of it."""
    return y[accuracy.coordinates : accuracy.coordinates + s.a.shape[0]]


@helper
def newton(problem, t_new, y, h, s, accuracy, counts):
    """Solve for udot at the end of the step. Returns (status, iterations).

    The first guess is the solution with f linearised at the start, so that stiff modes start close to their solution.
    """
    nq, nu = accuracy.coordinates, s.a.shape[0]
    copy(speeds_of(y, s, accuracy), s.begun)
    problem.resolve(y, speeds_of(y, s, accuracy), s.begun, FIXED, problem.constants)
    copy(s.rate, s.rate_new)
    end_of_step(problem, y, h, s, accuracy)
    _foresee(problem, y, s, nq)
    _add_correction(problem, s, accuracy)
    end_of_step(problem, y, h, s, accuracy)
    permitted = _INEXACT if suffices(s.stiff) else _ITERATIONS
    for iteration in range(1, permitted + 1):
        status = derivative(problem, t_new, s.y_new, s.f_new, counts)
        if status != OK:  # an iterate that is not finite does not mean that the motion diverges
            return NOT_CONVERGED if status == NONFINITE else status, iteration
        _residual(problem, s, accuracy)
        _correct(problem, h, s, accuracy)
        _add_correction(problem, s, accuracy)
        copy(s.y_new, s.y_before)
        end_of_step(problem, y, h, s, accuracy)
        if not all_finite(s.y_new):
            return NOT_CONVERGED, iteration
        for i in range(nq + nu):
            s.y_before[i] -= s.y_new[i]
        size = scaled_norm(s.y_before, s.y_new, accuracy)
        if size <= 1.0 or largest(s.correction) <= _ROUNDING * largest(s.rate_new):
            return OK, iteration
    return NOT_CONVERGED, permitted


@helper
def _residual(problem, s, accuracy):
    """What udot at y_new lacks, in the axes of speeds, which are those of J."""
    speeds = speeds_of(s.y_new, s, accuracy)
    copy(speeds_of(s.f_new, s, accuracy), s.correction)
    problem.resolve(s.y_new, speeds, s.correction, RATES, problem.constants)
    for j in range(s.correction.shape[0]):
        s.correction[j] -= s.rate_new[j]
    problem.resolve(s.y_new, speeds, s.correction, TURNING, problem.constants)


@helper
def _add_correction(problem, s, accuracy):
    """Add the correction, in the axes of speeds at y_new, to udot at the end."""
    problem.resolve(s.y_new, speeds_of(s.y_new, s, accuracy), s.correction, FIXED, problem.constants)
    for j in range(s.correction.shape[0]):
        s.rate_new[j] += s.correction[j]


@helper
def _foresee(problem, y, s, nq):
    """Correction of udot for the step from y to y_new, with f linearised."""
    if suffices(s.stiff):
        pulled_back(problem, y, s.y_new, s.correction, s.stiff)
        return
    for j in range(s.correction.shape[0]):
        total = 0.0
        for k in range(nq + s.correction.shape[0]):
            total += s.J[nq + j, k] * (s.y_new[k] - y[k])
        s.correction[j] = total
    lu_solve(s.matrix, s.pivots, s.correction)


@helper
def _correct(problem, h, s, accuracy):
    """Newton's correction of udot for the residual in s.correction, in place."""
    if suffices(s.stiff):
        a, b = shifts(h, accuracy.radius)
        filtered(problem, a, b, s.correction, s.stiff)
    else:
        lu_solve(s.matrix, s.pivots, s.correction)


@helper
def _linearise(problem, t, y, s, accuracy, counts):
    """Linearise at (t, y): the Jacobian, or the place of the stiff part where this suffices; returns a status code."""
    if suffices(s.stiff):
        return settle_at(problem, t, y, s.stiff)
    status = linearisation(problem, t, y, s.J, counts)
    _add_turning(problem, y, s, accuracy)
    return status


@helper
def _add_turning(problem, y, s, accuracy):
    """Add to J what `RATES` adds to udot: products of two different speeds, so that a difference over 1 is exact."""
    nq, nu, speeds = accuracy.coordinates, s.a.shape[0], speeds_of(y, s, accuracy)
    moved, still, column = s.increment, s.rate_new, s.correction
    for i in range(nu):
        still[i] = 0.0
    problem.resolve(y, speeds, still, RATES, problem.constants)
    problem.resolve(y, speeds, still, TURNING, problem.constants)
    for j in range(nu):
        copy(speeds, moved)
        moved[j] += 1.0
        for i in range(nu):
            column[i] = 0.0
        problem.resolve(y, moved, column, RATES, problem.constants)
        problem.resolve(y, moved, column, TURNING, problem.constants)
        for i in range(nu):
            s.J[nq + i, nq + j] += column[i] - still[i]


@sweep
def step_once(problem, step, y, h, h_factored, s, accuracy, counts):
    """One step of size h from y to y_new, with a new Jacobian if the iteration does not converge with the old one.

    An iterate beyond the range of a flexible body does not mean that the motion leaves it, unless nothing converges.
    Returns (status, step size of the factors, 0 if they are to be renewed).
    """
    for trial in range(3):  # with the old factors, without the Jacobian where it may be missed, then with it
        if trial > 0:
            status = _linearise(problem, step.start, y, s, accuracy, counts)
            if status != OK:
                return status, 0.0
        if trial > 0 or (h_factored > 0.0 and abs(h - h_factored) > _SAME * h):
            h_factored = h if factorise(problem, s, h, accuracy, counts) else 0.0
        status, iterations = NOT_CONVERGED, 0
        if h_factored > 0.0:
            status, iterations = newton(problem, min(step.end, step.last), y, h, s, accuracy, counts)
        if status != NOT_CONVERGED and status != OUT_OF_RANGE:
            sound = iterations < _WORN if trial == 0 else status == OK
            return status, h_factored if sound else 0.0
        if trial > 0 and not give_up(s.stiff):
            break
    return status, 0.0


@helper
def finish(problem, step, h, ends, s, result, controlled):
    """The state at the end of a successful step, with its quadratures by the trapezoidal rule, projected."""
    for i in range(controlled):
        result[i] = s.y_new[i]
    for i in range(controlled, result.shape[0]):
        result[i] = ends.y[i] + 0.5 * h * (s.f[i] + s.f_new[i])
    problem.project(step.end, result, problem.constants)


@handed_in
def attempt(problem, step, h, ends, s, known, accuracy, counts):
    """See `FixedMethod`; known[FRESH]: slopes are evaluated at the start of the step, where a is set to udot."""
    if known[FRESH] != 0.0:
        status = derivative(problem, step.start, ends.y, s.f, counts)
        if status != OK:
            return status
        copy(speeds_of(s.f, s, accuracy), s.rate)
        problem.resolve(ends.y, speeds_of(ends.y, s, accuracy), s.rate, RATES, problem.constants)
        copy(s.rate, s.a)
        known[FRESH] = 0.0
    status, known[FACTORED] = step_once(problem, step, ends.y, h, known[FACTORED], s, accuracy, counts)
    if status == OK:
        finish(problem, step, h, ends, s, ends.y_new, accuracy.controlled)
    return status


@handed_on
def inside(problem, step, ends, s, t, result, run):
    """The state within a step, by a shorter step from the same start with a new Jacobian."""
    accuracy, counts = run
    shorter, h = Interval(step.start, t, step.last), t - step.start
    status, _ = step_once(problem, shorter, ends.y, h, 0.0, s, accuracy, counts)
    finish(problem, shorter, h, ends, s, result, accuracy.controlled)
    return status


@handed_in
def no_detour(problem, watch, status, step, ends, s, samples, run):
    """See `FixedMethod`: the run ends before a singular position."""
    return status, step.start


@handed_in
def accept(s):
    """See `FixedMethod`."""
    copy(s.rate_new, s.rate)
    copy(s.a_new, s.a)
    copy(s.f_new, s.f)


@handed_in
def enter(known):
    """udot may jump where a segment ends."""
    known[FRESH] = 1.0


@handed_in
def keep(memory, s):
    """Store the Jacobian, or the place of the stiff part, slopes and a."""
    n, nu = s.f.shape[0], s.a.shape[0]
    for i in range(n):
        copy(s.J[i], memory.rows[i])
    if suffices(s.stiff):
        keep_place(s.stiff, memory.rows)
    copy(s.f, memory.rows[n])
    for j in range(nu):
        memory.rows[n + 1, j], memory.rows[n + 2, j] = s.rate[j], s.a[j]


@handed_in
def recall(problem, memory, s, known, accuracy, counts):
    """Restore these for a resumed run and factorise again; in any other run the first step starts without them."""
    n, nu = s.f.shape[0], s.a.shape[0]
    if known[TAKEN_UP] == 0.0:
        known[FRESH] = 1.0
        return
    for i in range(n):
        copy(memory.rows[i], s.J[i])
    recall_place(problem, s.stiff, memory.rows)
    copy(memory.rows[n], s.f)
    for j in range(nu):
        s.rate[j], s.a[j] = memory.rows[n + 1, j], memory.rows[n + 2, j]
    if known[FACTORED] > 0.0:
        factorise(problem, s, known[FACTORED], accuracy, counts)


@helper
def arrays(n, coordinates, a, rate, f):
    """Arrays for n components, the first of which are coordinates; a, udot and the slope at the start are given."""
    nu = a.shape[0]
    return NewmarkArrays(
        np.zeros((n, n)), np.empty((nu, nu)), np.empty(nu, np.int64), rate_blocks(coordinates), np.empty(nu), a,
        np.empty(nu), rate, np.empty(nu), np.empty(nu), np.empty(nu), f, np.empty(n), np.zeros(n), np.empty(n),
        stiff_place(n, coordinates, nu),
    )  # fmt: skip


@kernel
def generalised_alpha(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y = [q, u, quadratures] as described in `Integrator`; problem: a `StiffProblem`.

    Newton's method stops when its correction is below rtol |y| + atol in the norm of the controlled components. At the
    start and after every segment end, where udot may jump, a is set to udot.
    """
    n, nu = y.shape[0], accuracy.controlled - accuracy.coordinates
    s = arrays(n, accuracy.coordinates, np.empty(nu), np.empty(nu), np.empty(n))
    begin_without_jacobian(problem, s.stiff)
    ends = Ends(y, s.f, np.empty(n), s.f_new)
    looking = arrays(n, accuracy.coordinates, s.a, s.rate, s.f)
    begin_without_jacobian(problem, looking.stiff)
    method = FixedMethod(attempt, no_detour, accept, enter, recall, keep, inside, looking)
    return equal_steps(method, problem, (s, ends), clock, out, (accuracy, counts), memory, watch)


INTEGRATOR = Integrator(
    "generalised_alpha", generalised_alpha, order=2, fixed=True, linearises=True, keeps_jacobian=True,
    damps=True, matrices=2, algebra=(2.0 / 24.0, 1.0),  # a real matrix of the speeds
    summary="rough answers at large steps, with damping that is chosen",
)  # fmt: skip
