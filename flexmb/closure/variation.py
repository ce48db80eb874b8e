"""How the accelerations and the constraint loads of a closed chain change with the state, time and applied forces.

The accelerations solve M udot = tau - c + J'f with loads f that keep the row accelerations g'' zero. By the implicit
function theorem: `flexmb.closure.constant_loads` has the derivatives of udot and g'' at constant f, and a change df
adds M^-1 J' df to the former and J M^-1 J' df to the latter, so that

    df = -(J M^-1 J')^-1 d(g'')|f        dudot = d(udot)|f + M^-1 J' df

for the chosen independent rows. With M = L L' and the QR factorisation L^-1 J' = Q R, in which nothing is squared,

    df = -R^-1 R'^-1 d(g'')|f            dudot = d(udot)|f - L'^-1 Q R'^-1 d(g'')|f
    df/dtau = -R^-1 Q' L^-1              dudot/dtau = L'^-1 (1 - Q Q') L^-1

Rows that depend on the chosen ones carry no load: the loads that the motion determines do not depend on that choice.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from flexmb.closure.closures import Closures
from flexmb.closure.constant_loads import ConstantLoads
from flexmb.entry.variation import ByAllDirections, FreeVariation
from flexmb.typing import Index, Real


def variation(
    closures: Closures, t: float, y: Real, mass: Real, motion: Real, constant: ConstantLoads
) -> FreeVariation:
    """At y = [q, u, work], which must fulfil the closures, with the mass matrix (nu,nu) of the tree and N (nq,nu).

    DynamicsError where the closures are singular.
    """
    accelerations = closures.motion(t, y).accelerations
    chosen, least = closures.chosen_rows, closures.row_loads
    nu, free = len(mass), np.flatnonzero(closures.constants[0].speed["prescribed"] < 0)
    found = constant.changes(t, y, least)
    root = np.linalg.cholesky(mass[np.ix_(free, free)])
    half = solve_triangular(root, found.of_row_rates.by_speed[:, free].T, lower=True)  # L^-1 J'
    Q, R = np.linalg.qr(half[:, chosen])
    loads = np.zeros(len(least))
    loads[chosen] = solve_triangular(R, Q.T @ half @ least)
    if len(chosen) < len(least):
        found = constant.changes(t, y, loads)
    opening = solve_triangular(R, np.column_stack(found.of_row_accelerations)[chosen], trans=1)  # R'^-1 d(g'')|f
    of_loads, of_rates = np.zeros((len(loads), 2 * nu + 1)), np.column_stack(found.of_accelerations)
    of_loads[chosen] = -solve_triangular(R, opening)
    of_rates[free] -= solve_triangular(root, Q @ opening, lower=True, trans=1)
    R_inverse = np.linalg.inv(R)
    lever, inertia, by_force = (np.zeros((m, n)) for m, n in ((nu, len(loads)), (len(loads),) * 2, (len(loads), nu)))
    lever[np.ix_(free, chosen)] = solve_triangular(root, Q @ R_inverse.T, lower=True, trans=1)
    inertia[np.ix_(chosen, chosen)] = R_inverse @ R_inverse.T
    by_force[np.ix_(chosen, free)] = -solve_triangular(R, solve_triangular(root, Q, lower=True, trans=1).T)

    def by_all(change: Real, by_force: Real) -> ByAllDirections:
        return ByAllDirections(change[:, :nu], change[:, nu:-1], by_force, change[:, -1])

    return FreeVariation(
        accelerations, by_all(of_rates, _by_force(root, Q, free, nu)), motion, loads, by_all(of_loads, by_force),
        lever, inertia,
    )  # fmt: skip


def _by_force(root: Real, Q: Real, free: Index, nu: int) -> Real:
    """(nu,nu) L'^-1 (1 - Q Q') L^-1, as a product with itself, so that it is symmetric."""
    inverse = solve_triangular(root, np.eye(len(free)), lower=True)
    left = inverse - Q @ (Q.T @ inverse)
    out = np.zeros((nu, nu))
    out[np.ix_(free, free)] = left.T @ left
    return out
