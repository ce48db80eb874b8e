"""Exact derivatives of observed quantities by the states of a linear model and by generalised forces.

At given constraint loads f (none in a tree), and by f, they are found with dual numbers. Let Y be the change of [q, u]
by [xi; du], and g'' = K f + c the row accelerations, which stay zero. Then

    df = -K^+ d(g'')|f Y + (1 - K^+ K) dK K^+ f Y

since f is the minimum-norm solution. A generalised force t along the free speeds changes the accelerations by M^-1 t at
given f, which changes the hinge loads by inverse dynamics, and it changes f by -K^+ J M^-1 t.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.closure.observed_tangent import closed_observed_jacobian
from flexmb.entry.observed_tangent import observed_jacobian, outputs_tangent
from flexmb.linear.closed_variations import ClosedEquations
from flexmb.linear.variations import Equations, Variations
from flexmb.system.observables import Observation
from flexmb.tables.state import State, pack
from flexmb.typing import Real

LARGE = 2.0**20
"""Change of an acceleration, whose effect is linear: large, so that the rounding of others is negligible."""


class ObservedTangent(NamedTuple):
    """A row (E,) of observed quantities, laid out as `Observation.columns`, and its derivatives: by the state
    [xi; du] (E,2f) of a linear model, by generalised forces along the n free speeds (E,n)."""

    value: Real
    by_state: Real
    by_force: Real


class _Raw(NamedTuple):
    """The row (E,), and the derivatives of it and the row accelerations by [q, u] and by the row loads."""

    value: Real
    by_y: Real
    by_load: Real


def observed(equations: Equations, at: Variations) -> ObservedTangent:
    """The observed row and its derivatives at the state of `at`; DynamicsError where accelerations do not exist."""
    state, found = at.state, _free(equations, at.state)
    Y, by_force = moving(equations, at), _by_force(equations, state)
    by_state = found.by_y @ Y
    rows, E = found.by_load.shape[1], len(found.value)
    if not rows:
        return ObservedTangent(found.value, by_state, by_force)
    assert isinstance(equations, ClosedEquations)  # it has closures
    K, by_load = found.by_load[E:], found.by_load[:E]
    inverse = _inverse(K, equations.rank)
    loads = -inverse @ by_state[E:]
    if equations.rank < rows:
        held, closures = equations.closure_loads(state)
        other = _raw(equations, state, held + inverse @ held, closures).by_y[E:] - found.by_y[E:]  # dK K^+ f
        loads += (np.eye(rows) - inverse @ K) @ other @ Y
    pushed = -inverse @ equations.row_rates(state) @ np.linalg.inv(equations.mass(state))
    return ObservedTangent(found.value, by_state[:E] + by_load @ loads, by_force + by_load @ pushed)


def values(equations: Equations, state: State) -> Real:
    """The row (E,) of observed quantities at a state; DynamicsError where accelerations do not exist."""
    return _free(equations, state).value


def _free(equations: Equations, state: State) -> _Raw:
    """The row and its derivatives at a state, under its own constraint loads."""
    if not isinstance(equations, ClosedEquations):
        return _raw(equations, state, np.zeros(0), np.zeros(0))
    return _raw(equations, state, *equations.closure_loads(state))


def _raw(equations: Equations, state: State, load: Real, closures: Real) -> _Raw:
    """The row and its derivatives at a state under row loads (G,) and the corresponding loads of closures (C,6)."""
    system, y, rows = equations.system, pack(state), len(load)
    observation: Observation = system.observation
    out, E = outputs_tangent(observation.out), observation.width
    J = np.empty((E + rows, len(y) + rows))
    if isinstance(equations, ClosedEquations):
        status = closed_observed_jacobian(state.t, y, J, *equations.with_row_loads(load), out)
    else:
        status = observed_jacobian(state.t, y, J, *equations.tangent_tables, out)
    equations.check(status)
    row = np.concatenate([out.every[:, 0], out.drives[:, 0], closures.ravel()])
    return _Raw(row, J[:, : len(y) - 1], J[:, len(y) :])


def moving(equations: Equations, at: Variations) -> Real:
    """Y (nq+nu,2f): change of [q, u] by [xi; du]."""
    nq, f = equations.system.nq, len(at.chosen)
    Y = np.zeros((nq + equations.system.nu, 2 * f))
    Y[:nq, :f] = at.motion
    Y[nq + equations.free] = at.by_chosen[len(equations.free) :]
    return Y


def _by_force(equations: Equations, state: State) -> Real:
    """(E,n) derivatives by generalised forces along the free speeds, at given constraint loads."""
    system, free = equations.system, equations.free
    places = system.observation.columns
    whole = system.mass_matrix(state)
    rates = np.zeros((system.nu, len(free)))
    rates[free] = np.linalg.inv(whole[np.ix_(free, free)])
    found = np.zeros((system.observation.width, len(free)))
    resting = _of_rates(equations, state, np.zeros(system.nu))
    for i, column in enumerate(rates.T):
        for name, change in _of_rates(equations, state, LARGE * column).items():
            found[places[name][0], i] = (change - resting[name]).ravel() / LARGE
    driven = np.flatnonzero(system.constants.speed["prescribed"] >= 0)
    found[places["drives"][0].start + driven] = whole[driven] @ rates
    return found


def _of_rates(equations: Equations, state: State, rates: Real) -> dict[str, Real]:
    """The quantities that depend on accelerations (nu,): hinge loads by inverse dynamics, markers."""
    system, y = equations.system, pack(state)
    system.observe_rates(state.t, y, rates)
    out = system.observation.out
    return {"rates": rates, "loads": out.loads.copy(), "markers": out.markers.copy()}


def _inverse(K: Real, rank: int) -> Real:
    """K^+ (G,G) of a symmetric matrix of this rank."""
    values, vectors = np.linalg.eigh(0.5 * (K + K.T))
    kept = slice(len(K) - rank, None)
    return np.asarray(vectors[:, kept] / values[kept] @ vectors[:, kept].T, float)
