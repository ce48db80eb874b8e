"""Inverse dynamics, and the modal accelerations that hinge accelerations bring with them."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb
from flexmb.entry import consistent
from flexmb.entry.consistent import held_hinges
from flexmb.jit.counting import count
from tests.benchmarks.rivals import flexible_chain
from tests.bounds import gamma
from tests.flexmb.jain.random_states import LEVELS, RandomState, random_state

FLEXIBLE = [level for level in LEVELS if level != "rigid"]
CARRIERS = ("rigid", "modal", "floating", "beam")


@pytest.fixture(scope="module", params=[(level, n) for level in FLEXIBLE for n in (1, 8, 60)], ids=str)
def found(request) -> RandomState:
    level, bodies = request.param
    carriers = {} if level == "exact" else {"carriers": CARRIERS[1:] + CARRIERS[:1]}
    return random_state(bodies + 1, level, bodies, branching=bodies < 60, **carriers)


def largest(residual: dict[str, np.ndarray]) -> float:
    return max(float(np.max(np.abs(rows))) for rows in residual.values())


def test_the_free_motion_needs_no_modal_forces(found):
    """T^f = 0 and T^r the springs and motors (45): accelerations of the recursion are a consistent set."""
    system, state = found.system, found.state
    rates = system.accelerations(state)
    size = gamma(system.nu) * found.inertia(rates)
    assert largest(system.modal_residual(state, rates)) <= size
    left = system.inverse_dynamics(state, rates) - system.applied(state)
    assert np.max(np.abs(left[found.free])) <= size


def test_inconsistent_accelerations_are_reported(found):
    """One mode accelerated otherwise: the residual shows the force of just that, M_ff times the difference (45)."""
    system, state = found.system, found.state
    rates = system.accelerations(state)
    mode = int(np.flatnonzero(found.modal)[0])
    push = max(1.0, 1e-3 * float(np.max(np.abs(rates))))  # fast modes of strains accelerate by far more than others
    rates[mode] += push
    residual = np.concatenate(list(system.modal_residual(state, rates).values()))
    size = gamma(system.nu) * found.inertia(rates)
    expected = push * found.M[mode, mode]
    assert expected > 1e3 * size
    assert np.max(np.abs(residual)) >= expected - size


def test_modal_residuals_are_the_modal_rows(found):
    """By body, bodies without modes left out."""
    rates = np.random.default_rng(0).normal(size=found.system.nu)
    tau = found.system.inverse_dynamics(found.state, rates)
    residual = found.system.modal_residual(found.state, rates)
    for name, rows in residual.items():
        assert np.array_equal(rows, tau[found.system.speed(f"{name}.modes")])
    assert sum(len(rows) for rows in residual.values()) == np.sum(found.modal)


def test_consistent_accelerations(found):
    """T^f = 0 for any accelerations of hinges and wheels (45), as elimination of the modes from M and C has it."""
    system, state, modal = found.system, found.state, found.modal
    wanted = np.random.default_rng(1).normal(size=system.nu)
    rates, tau = system.consistent_inverse_dynamics(state, wanted)
    assert np.array_equal(rates[~modal], wanted[~modal])
    size = gamma(system.nu) * found.inertia(rates)
    assert largest(system.modal_residual(state, rates)) <= size
    assert np.max(np.abs(tau - found.M @ rates - found.bias)) <= found.bound * found.inertia(rates)
    expected = -np.linalg.solve(
        found.M[np.ix_(modal, modal)], found.bias[modal] + found.M[np.ix_(modal, ~modal)] @ wanted[~modal]
    )
    assert np.max(np.abs(found.M[np.ix_(modal, modal)] @ (rates[modal] - expected))) <= size


def test_consistent_accelerations_of_the_free_motion_are_the_free_motion(found):
    """Given hinge accelerations of the recursion, structures follow as they do in it (45).

    Modal accelerations of both solve M_ff x = b, each with a residual e of rounding: they differ by M_ff^-1 e, of which
    the hinges feel M_rf M_ff^-1 e beside their own rounding.
    """
    system, state, modal, free = found.system, found.state, found.modal, found.free
    rates = system.accelerations(state)
    again, tau = system.consistent_inverse_dynamics(state, np.where(modal, np.nan, rates))
    size = gamma(system.nu) * found.inertia(rates)
    M_ff, M_fr = found.M[np.ix_(modal, modal)], found.M[np.ix_(modal, free)]
    assert np.max(np.abs(M_ff @ (again - rates)[modal])) <= size
    felt = np.sum(np.abs(np.linalg.solve(M_ff, M_fr)), axis=0)
    assert np.all(np.abs((tau - system.applied(state))[free]) <= size * (1.0 + felt))


def test_rigid_bodies_have_nothing_to_follow():
    found = random_state(1, "rigid", 5)
    wanted = np.random.default_rng(2).normal(size=found.system.nu)
    assert found.system.modal_residual(found.state, wanted) == {}
    rates, tau = found.system.consistent_inverse_dynamics(found.state, wanted)
    assert np.array_equal(rates, wanted)
    assert np.array_equal(tau, found.system.inverse_dynamics(found.state, wanted))


def test_operations_grow_with_the_bodies():
    """O(N), inverse dynamics (44), (45) and its consistent form alike."""

    def totals(bodies):
        system = flexmb.compile(flexible_chain(bodies, 3, "full"))
        state = system.initial_state
        y, rates = np.concatenate([state.q, state.u, [0.0]]), np.ones(system.nu)
        c, w = system.constants, system.workspace()
        written = np.zeros(system.nu), np.zeros((bodies, 6))
        forced = count(flexmb.entry.articulated.inverse_dynamics, 0.0, y, rates, c, w, *written)
        followed = count(consistent.consistent_accelerations, 0.0, y, rates, c, *held_hinges(c, w))
        return np.array([forced.operations.total, followed.operations.total])

    cost = np.array([totals(bodies) for bodies in (2, 4, 6)])
    assert np.array_equal(cost[2] - cost[1], cost[1] - cost[0])
    assert np.all(cost[1] > cost[0])
