"""Exact derivatives of observed quantities by the states of a linear model and by generalised forces.

The motion changes along each of these with its accelerations and the loads of closures, which are known
(`Equations.free_variation`); everything observable follows along them in dual numbers (`flexmb.system.pushforward`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.linear.variations import Equations, Variations
from flexmb.system.pushforward import Directions, GivenMotion
from flexmb.tables.state import State, finite_result, pack
from flexmb.typing import Real


class ObservedTangent(NamedTuple):
    """A row (E,) of observed quantities, laid out as `Observation.columns`, and its derivatives: by the state
    [xi; du] (E,2f) of a linear model, by generalised forces along the n free speeds (E,n). NaN for loads that the
    motion does not determine."""

    value: Real
    by_state: Real
    by_force: Real


def observed(equations: Equations, at: Variations) -> ObservedTangent:
    """The observed row and its derivatives at the state of `at`; DynamicsError where accelerations do not exist."""
    state, free, n = at.state, equations.free, len(equations.free)
    found, push = at.free, equations.pushforward
    xi, du = at.by_chosen[:n], at.by_chosen[n:]
    of_rates, of_loads = (
        np.hstack([of.by_displacement[:, free] @ xi + of.by_speed[:, free] @ du, of.by_force[:, free]])
        for of in (found.of_accelerations, found.rows.of_loads)
    )
    Y = moving(equations, at)
    of_state = np.hstack([Y, np.zeros((len(Y), n))])
    motion = GivenMotion(state.t, pack(state), found.accelerations, found.rows.loads)
    directions = Directions(of_state, of_rates, of_loads, np.zeros(of_rates.shape[1]))
    change = finite_result(push.derivatives(motion, directions, push.row), state.t)
    change[equations.undetermined(state)] = np.nan
    return ObservedTangent(push.row(slice(0, 1))[:, 0], *np.hsplit(change, [Y.shape[1]]))


def values(equations: Equations, state: State) -> Real:
    """The row (E,) of observed quantities at a state; DynamicsError where accelerations do not exist."""
    return equations.pushforward.value(equations.motion(state))


def moving(equations: Equations, at: Variations) -> Real:
    """Y (nq+nu,2f): change of [q, u] by [xi; du]."""
    nq, f = equations.system.nq, len(at.chosen)
    Y = np.zeros((nq + equations.system.nu, 2 * f))
    Y[:nq, :f] = at.motion
    Y[nq + equations.free] = at.by_chosen[len(equations.free) :]
    return Y
