"""Exponential collocation with error control and dense output.

Over a step f(t, y) is a linear part J (y - y_n), treated exactly, and the rest

    r = f(t, y) - f(t_n, y_n) - J (y - y_n),

which is collocated by a polynomial of degree 4 at 0, 1/4, 1/2, 3/4 and 1 of the step. So fast linear modes neither
limit the step nor are damped; the step depends on the smoothness of r. The collocation equations are solved by a
fixed-point iteration, which converges however stiff J is and gains two orders per sweep, because r starts flat.
J is the Jacobian at the start of each step, as in the exponential Rosenbrock methods of Hochbruck, Ostermann, Acta
Numerica 19 (2010), 209, section 2.4; this is the collocation method among them. Its order is 6, that of Boole's rule,
at J = 0, and 5 for any J.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from flexmb.integrate.adaptive import (
    Method,
    adaptive,
    after_leap_by_error,
    enter_afresh,
    keep_nothing,
    recall_nothing,
    reject_by_error,
)
from flexmb.integrate.control import (
    FACTORISATIONS,
    copy,
    derivative,
    linearisation,
    next_step,
    scaled_norm,
    step_factor,
)
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.linear_flow import LEVELS, TERMS, Flow, at_fraction, at_quarters, prepare, respond
from flexmb.integrate.memory import ERROR_BEFORE, RETRIED, STEP
from flexmb.integrate.newton_matrix import NewtonMatrix, rate_blocks, unfactorised
from flexmb.integrate.settling import prepare_settling, settle
from flexmb.integrate.watch import Ends
from flexmb.jit.kernel import handed_in, handed_on, helper, kernel
from flexmb.tables.status import NONFINITE, NOT_CONVERGED, OK

NODES = np.array([0.25, 0.5, 0.75, 1.0])
# Row l: l-th derivative at 0 of the polynomial that vanishes at 0 and has given values at the nodes.
_powers = np.arange(1, TERMS)
DERIVATIVES = np.array([math.factorial(l) for l in _powers])[:, None] * np.linalg.inv(NODES[:, None] ** _powers)
# Derivatives at 0 of x (x - 1/4) (x - 3/4) (x - 1): without the middle node the polynomial differs by a multiple of it.
WITHOUT_MIDDLE = np.array([0.0, -3.0 / 16.0, 19.0 / 8.0, -12.0, 24.0])

_SWEEPS = 8  # maximum number of sweeps of the iteration
_CONVERGED = 0.02  # error that the iteration may leave, in units of the tolerance
RATE = 4.0  # rate per step of `settle`: stiff components displaced by a projection relax within the step
_ERROR_EXPONENT = 5.0  # the error estimate is O(h^5)
# Strongest growth of a step. While a body rests on a stop, its vibration is linear, hence exact at any step, and errors
# vanish; a step that stayed within half a period is followed by one whose nodes are at most half a period apart, so
# that one of them sees it leave the stop. Tenfold steps had all nodes in phase, and bodies stuck to stops.
_GROW = 4.0


class Collocation(NamedTuple):
    """Arrays of a step: slope f at its start; J (n,n) and its flow; polynomials v, v_error (TERMS,n) and the responses
    X, X_error to them; states x (4,n) at the nodes.
    """

    flow: Flow
    f: np.ndarray
    J: np.ndarray
    v: np.ndarray
    v_error: np.ndarray
    X: np.ndarray
    X_error: np.ndarray
    x: np.ndarray
    x_before: np.ndarray
    rest: np.ndarray  # (4,n)
    y_new: np.ndarray
    f_new: np.ndarray
    error: np.ndarray
    term: np.ndarray
    product: np.ndarray
    real: NewtonMatrix
    change: np.ndarray
    linearised_at: np.ndarray  # (1,) s, of J


@helper
def response(s, terms):
    """x at the quarters of the step as the response to the first `terms` terms of the polynomial v."""
    respond(s.flow, s.v, terms, s.X)
    at_quarters(s.flow, s.X, s.x)


@helper
def change(s, y, accuracy):
    """Scaled norm of the change of x at the nodes by a sweep, root mean square over the nodes."""
    total = 0.0
    for node in range(4):
        for i in range(y.shape[0]):
            s.error[i] = s.flow.scale[i] * (s.x[node, i] - s.x_before[node, i])
        total += scaled_norm(s.error, y, accuracy) ** 2
    return math.sqrt(0.25 * total)


@helper
def evaluate_rest(problem, step, y, s, counts):
    """h r at the nodes, balanced, and from it the polynomial v; returns a status code."""
    n, h, flow = y.shape[0], step.end - step.start, s.flow
    for node in range(4):
        for i in range(n):
            s.y_new[i] = y[i] + flow.scale[i] * s.x[node, i]
        status = derivative(problem, min(step.start + NODES[node] * h, step.last), s.y_new, s.f_new, counts)
        if status != OK:
            return status
        for i in range(n):
            row, total = flow.Z[i], 0.0
            for j in range(n):
                total += row[j] * s.x[node, j]
            s.rest[node, i] = h * (s.f_new[i] - s.f[i]) / flow.scale[i] - total
    for l in range(1, TERMS):
        for i in range(n):
            total = 0.0
            for node in range(4):
                total += DERIVATIVES[l - 1, node] * s.rest[node, i]
            s.v[l, i] = total
    return OK


@helper
def iterate(problem, step, y, s, accuracy, counts):
    """Solve for x at the nodes; returns a status code, NOT_CONVERGED if _SWEEPS sweeps are not expected to suffice."""
    h = step.end - step.start
    for i in range(y.shape[0]):
        s.v[0, i] = h * s.f[i] / s.flow.scale[i]
    response(s, 1)
    before = 0.0
    for sweep in range(1, _SWEEPS + 1):
        for node in range(4):
            copy(s.x[node], s.x_before[node])
        status = evaluate_rest(problem, step, y, s, counts)
        if status != OK:
            return status
        response(s, TERMS)
        size = change(s, y, accuracy)
        if not math.isfinite(size):
            return NONFINITE
        if size <= _CONVERGED:
            return OK
        if sweep > 1:
            rate = size / before
            if rate >= 1.0 or rate ** (_SWEEPS - sweep) * size > _CONVERGED:
                return NOT_CONVERGED
            if rate / (1.0 - rate) * size <= _CONVERGED:
                return OK
        before = size
    return NOT_CONVERGED


@helper
def estimate(y, s, accuracy):
    """Scaled norm of the middle node's contribution, the larger one of those at the middle and the end. Uses x_before.

    The middle is included because a stiff component follows r at once: the middle node then has no effect at the end,
    but affects samples inside the step.
    """
    n, flow = y.shape[0], s.flow
    for i in range(n):
        s.term[i] = max(abs(y[i]), abs(s.y_new[i]))
        for l in range(TERMS):
            s.v_error[l, i] = WITHOUT_MIDDLE[l] * s.v[TERMS - 1, i] / 24.0
    respond(flow, s.v_error, TERMS, s.X_error)
    at_quarters(flow, s.X_error, s.x_before)
    norm = 0.0
    for node in (1, 3):
        for i in range(n):
            s.error[i] = flow.scale[i] * s.x_before[node, i]
        norm = max(norm, scaled_norm(s.error, s.term, accuracy))
    return norm


@handed_in
def attempt(problem, step, ends, s, known, accuracy, counts):
    """See `flexmb.integrate.adaptive.Method`."""
    h = step.end - step.start
    if s.linearised_at[0] != step.start:
        status = linearisation(problem, step.start, ends.y, s.J, counts)
        if status != OK:
            return status, (math.inf,)
        s.linearised_at[0] = step.start
    counts[FACTORISATIONS] += 1
    if not prepare(s.flow, s.J, h):
        return NOT_CONVERGED, (math.inf,)
    status = iterate(problem, step, ends.y, s, accuracy, counts)
    if status != OK:
        return status, (math.inf,)
    for i in range(ends.y.shape[0]):
        ends.y_new[i] = ends.y[i] + s.flow.scale[i] * s.x[3, i]
    error = estimate(ends.y, s, accuracy)
    if error < 1.0:
        prepare_settling(problem, RATE / h, s)
        settle(problem, step.end, RATE / h, ends.y_new, s, accuracy)
        status = derivative(problem, min(step.end, step.last), ends.y_new, ends.dy_new, counts)
    return status, (error,)


@handed_in
def accept(step, cut, verdict, s, known, exponent):
    """See `flexmb.integrate.adaptive.Method`: as by the error alone, with growth up to _GROW."""
    length, error = step.end - step.start, verdict[0]
    factor = min(_GROW, step_factor(error, known[ERROR_BEFORE], exponent, known[RETRIED] != 0.0))
    known[STEP] = next_step(known[STEP], length, factor, cut)
    known[ERROR_BEFORE], known[RETRIED] = error, 0.0


@handed_on
def state_at(problem, step, ends, s, t, result, run):
    """The state inside a step, by the exact flow under the same polynomial, projected; see `flexmb.integrate.watch`."""
    accuracy, _ = run
    theta = (t - step.start) / (step.end - step.start)
    at_fraction(s.flow, s.v, s.X, s.x, theta, result, s.term, s.product)
    for i in range(result.shape[0]):
        result[i] = ends.y[i] + s.flow.scale[i] * result[i]
    settle(problem, t, RATE / (step.end - step.start), result, s, accuracy)
    return OK


@helper
def scratch(n, coordinates):
    """Uninitialised arrays for n components."""
    flow = Flow(
        np.empty((n, n)), np.empty(n), np.empty((LEVELS, n, n)), np.empty((TERMS, n, n)), np.empty((5, n, n)),
        np.empty(1, np.int64),
    )  # fmt: skip
    return Collocation(
        flow, np.empty(n), np.empty((n, n)), np.empty((TERMS, n)), np.empty((TERMS, n)), np.empty((LEVELS, TERMS, n)),
        np.empty((LEVELS, TERMS, n)), np.empty((4, n)), np.empty((4, n)), np.empty((4, n)), np.empty(n), np.empty(n),
        np.empty(n), np.empty(n), np.empty(n), unfactorised(n, coordinates, rate_blocks(coordinates), np.float64),
        np.empty(n), np.full(1, np.nan),
    )  # fmt: skip


@kernel
def exponential(problem, y, clock, accuracy, out, counts, memory, watch):
    """Integrate y' = f(t, y) as described in `Integrator`; problem: a `StiffProblem`.

    If the iteration does not converge, the step is halved.
    """
    s = scratch(y.shape[0], accuracy.coordinates)
    ends = Ends(y, s.f, s.y_new, s.f_new)
    method = Method(
        attempt, accept, reject_by_error, after_leap_by_error, enter_afresh, recall_nothing, keep_nothing, state_at,
        _ERROR_EXPONENT,
    )  # fmt: skip
    return adaptive(method, problem, (s, ends), clock, out, (accuracy, counts), memory, watch)


INTEGRATOR = Integrator(
    "exponential", exponential, order=5, linearises=True, matrices=48,
    algebra=(40.0, 10.0),  # an exponential of a matrix
    summary="stiff scenes at higher accuracy, and ringing that must not be damped; order 6 where nothing is stiff",
)  # fmt: skip
