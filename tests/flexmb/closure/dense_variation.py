"""How a closed chain's motion changes, by another route than `flexmb.closure.variation`: dense factors, dual numbers.

Along each direction the change of what balances at given accelerations and loads is found in dual numbers
(`flexmb.system.pushforward`): dr of M udot + c - tau - J'f and dg of J udot + gamma. With M = L L' and the QR
factorisation L^-1 J' = Q R of the independent rows, in which nothing is squared,

    R'R df = -(dg - J M^-1 dr)           dudot = -M^-1 dr + M^-1 J' df
    df/dtau = -R^-1 Q' L^-1              dudot/dtau = L'^-1 (1 - Q Q') L^-1
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

import flexmb as fm
from flexmb.system.pushforward import GivenMotion
from flexmb.typing import Real


class Dense(NamedTuple):
    """Of the accelerations (nu,nu) and the loads (G,nu) of the rows; of what balances (nu+G,), which should be zero."""

    by_displacement: Real
    by_speed: Real
    by_force: Real
    by_time: Real
    loads_by_displacement: Real
    loads_by_speed: Real
    loads_by_force: Real
    loads_by_time: Real
    balance: Real


def dense(system: Any, state: fm.State) -> Dense:
    """At a state that fulfils the closures, for the loads and the choice of rows that the product has made."""
    t, y = system.layout.entering(state)
    at, nu = system.linearisation._variation(t, y), system.nu
    free, chosen = np.flatnonzero(system.constants.speed["prescribed"] < 0), at.rows.chosen
    held = np.setdiff1d(np.arange(nu), free)
    push, directions = system.linearisation._pushforward, system.linearisation._directions(at.motion, 0)
    directions.accelerations[held, -1] = at.of_accelerations.by_time[held]  # as their functions do
    change = push.derivatives(GivenMotion(t, y, at.accelerations, at.rows.loads), directions, push.balance)
    balance = push.balance(slice(0, 1))[:, 0]
    balance[held] = 0.0  # what drives supply
    root = np.linalg.cholesky(system.mass_matrix(state)[np.ix_(free, free)])
    J = system.closure_operators(state).J[np.ix_(chosen, free)]
    Q, R = np.linalg.qr(solve_triangular(root, J.T, lower=True))
    left = solve_triangular(root, change[free], lower=True)  # L^-1 dr
    opening = change[nu + chosen] - R.T @ (Q.T @ left)
    pushed = solve_triangular(R, opening, trans=1)
    of_rates, of_loads = np.zeros((nu, 2 * nu + 1)), np.zeros((len(at.rows.loads), 2 * nu + 1))
    of_rates[free] = -solve_triangular(root, left + Q @ pushed, lower=True, trans=1)
    of_loads[chosen] = -solve_triangular(R, pushed)
    inverse = solve_triangular(root, np.eye(len(free)), lower=True)
    by_force, loads_by_force = np.zeros((nu, nu)), np.zeros((len(of_loads), nu))
    by_force[np.ix_(free, free)] = inverse.T @ (inverse - Q @ (Q.T @ inverse))
    loads_by_force[np.ix_(chosen, free)] = -solve_triangular(R, Q.T @ inverse)
    of_rates[held, -1] = at.of_accelerations.by_time[held]
    for of in (of_rates, of_loads):
        of[:, held] = of[:, nu + held] = 0.0
    return Dense(
        of_rates[:, :nu], of_rates[:, nu:-1], by_force, of_rates[:, -1],
        of_loads[:, :nu], of_loads[:, nu:-1], loads_by_force, of_loads[:, -1], balance,
    )  # fmt: skip
