"""Identities of the equations of motion on random trees, and proof that they would notice a wrong constant.

Agreement with the dense route is `test_dense_and_compiled`; here the recursions answer to themselves and to algebra.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.scene.build import SceneBuilder
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError
from tests import trees
from tests.bounds import algebra, backward_error
from tests.unlocked import unlocked

RECIPES = {
    "rigid": trees.RIGID, "full": trees.FULL, "mixed": trees.MIXED, "free-flying": trees.FREE_FLYING,
    "linear": trees.LINEAR, "every level": trees.EVERY_LEVEL, "exact": trees.EXACT,
}  # fmt: skip
CASES = [(name, seed) for name in RECIPES for seed in (10, 11)]
POINTS = 15  # most inertia points of a body in the random trees: three elements, five sections


@pytest.fixture(scope="module", params=CASES, ids=str)
def system(request) -> System:
    name, seed = request.param
    return flexmb.compile(trees.random_scene(seed, RECIPES[name]))


def bound(system: System) -> float:
    return algebra(system.nu, len(system.body_names), POINTS)


def free_speeds(system: System) -> np.ndarray:
    return system.constants.speed["prescribed"] < 0


def forces(system: System) -> float:
    """Size of the generalised forces before they cancel."""
    state = system.initial_state
    rates = system.accelerations(state)
    return float(np.max(np.abs(system.mass_matrix(state)) @ np.abs(rates) + np.abs(system.bias(state))))


def test_forward_dynamics_inverts_inverse_dynamics(system):
    """M udot + c = applied forces in every free row, by the O(N) recursions in both directions."""
    state = system.initial_state
    residual = system.inverse_dynamics(state, system.accelerations(state)) - system.applied(state)
    assert np.max(np.abs(residual[free_speeds(system)])) <= bound(system) * forces(system)


def test_articulated_and_composite_accelerations_solve_the_same_equations(system):
    state, free = system.initial_state, free_speeds(system)
    M, right = system.mass_matrix(state), system.applied(state) - system.bias(state)
    for algorithm in ("articulated", "composite"):
        rates = system.accelerations(state, algorithm)
        assert backward_error(M[free], rates, right[free], np.abs(system.bias(state))) <= bound(system), algorithm


def test_inverse_dynamics_is_affine_in_the_accelerations(system):
    state, rates = system.initial_state, np.random.default_rng(0).normal(size=system.nu)
    M, c = system.mass_matrix(state), system.bias(state)
    size = np.max(np.abs(M) @ np.abs(rates) + np.abs(c))
    assert np.max(np.abs(system.inverse_dynamics(state, rates) - M @ rates - c)) <= bound(system) * size


def test_mass_matrix_is_symmetric_and_positive_definite(system):
    M = system.mass_matrix(system.initial_state)
    scale = np.sqrt(np.outer(np.diag(M), np.diag(M)))  # |M_ij| is at most this
    assert np.max(np.abs(M - M.T) / scale) <= bound(system)
    assert np.linalg.eigvalsh(M / scale)[0] > system.nu * bound(system)


def test_kinetic_energy_is_the_quadratic_form_of_the_mass_matrix(system):
    state = system.initial_state
    u, M = state.u, system.mass_matrix(state)
    terms = 0.5 * np.abs(u) @ np.abs(M) @ np.abs(u)
    assert abs(system.energy(state)["kinetic"] - 0.5 * u @ M @ u) <= bound(system) * terms


def test_applied_forces_move_only_what_they_act_on(system):
    """A generalised force f in one free speed changes the accelerations by M^-1 f, here against a linear solve."""
    state, free = system.initial_state, free_speeds(system)
    before = system.accelerations(state)
    j = int(np.flatnonzero(free & (system.constants.speed["coordinate"] >= 0))[0])
    unlocked(system.constants).speed["damping"][j] += 3.0
    try:
        after = system.accelerations(state)
    finally:
        system.constants.speed["damping"][j] -= 3.0
    push = np.zeros(system.nu)
    push[j] = -3.0 * system.initial_state.u[j]
    M = system.mass_matrix(state)
    residual = M[free] @ (after - before) - push[free]
    assert np.max(np.abs(residual)) <= 2.0 * bound(system) * (forces(system) + np.max(np.abs(push)))


def agrees_with_the_dense_route(system: System) -> bool:
    state, free = system.initial_state, free_speeds(system)
    dense = DenseSystem(system.scene)
    M, c = dense.mass_matrix(state.q), dense.bias(state.q, state.u)
    right = dense.applied(state.q, state.u) - c
    return backward_error(M[free], system.accelerations(state), right[free], np.abs(c)) <= bound(system)


def _reverse_gyration(c):
    c.gyration[:] *= -1.0


def _transpose_a_placement(c):
    R = c.body["placement_rotation"][0].reshape(3, 3)
    c.body["placement_rotation"][0] = R.T.ravel()


def _drop_coriolis(c):
    c.product[:, :, 1:] = 0.0


def _mass_one_in_a_million_more(c):
    c.body["rigid"][1, 0] *= 1.0 + 1e-6


def _transpose_a_port(c):
    k = int(np.flatnonzero(c.body["inboard_port"] >= 0)[0])
    port = c.port["frame"][c.body["inboard_port"][k]]
    port[:] = port.reshape(3, 3).T.ravel().copy()


def _lose_a_wheels_gyroscopic_torque(c):
    c.wheel["axial"] *= 1.0 + 1e-6


def _reverse_a_spring(c):
    j = int(np.flatnonzero(c.speed["stiffness"])[0])
    c.speed["stiffness"][j] *= -1.0


def _forget_turning_inertia(c):
    c.point["inertia"] = 0.0


def _forget_the_slope_of_the_coupling(c):
    c.slope["mfr"] = 0.0


def _reverse_the_coriolis_force_on_modes(c):
    c.slope["coriolis"] *= -1.0


def _forget_the_centrifugal_softening(c):
    c.slope["gyration"] = 0.0


def _freeze_the_modal_masses(c):
    c.mass_slope[:] = 0.0


TAMPERS: list[tuple[trees.Recipe, Callable]] = [
    (trees.RUTHLESS, _reverse_gyration), (trees.RIGID, _transpose_a_placement), (trees.FULL, _drop_coriolis),
    (trees.RIGID, _mass_one_in_a_million_more), (trees.FULL, _transpose_a_port),
    (trees.RIGID, _lose_a_wheels_gyroscopic_torque), (trees.RIGID, _reverse_a_spring),
    (trees.FULL, _forget_turning_inertia),
    (trees.LINEAR, _forget_the_slope_of_the_coupling), (trees.LINEAR, _reverse_the_coriolis_force_on_modes),
    (trees.LINEAR, _forget_the_centrifugal_softening), (trees.LINEAR, _freeze_the_modal_masses),
    (trees.LINEAR, _forget_turning_inertia),
]  # fmt: skip


@pytest.mark.parametrize(("recipe", "tamper"), TAMPERS, ids=[f.__name__.strip("_") for _, f in TAMPERS])
def test_a_wrong_constant_is_noticed(recipe, tamper):
    system = flexmb.compile(trees.random_scene(12, trees.replace(recipe, bodies=6)))
    assert agrees_with_the_dense_route(system)
    tamper(unlocked(system.constants))
    assert not agrees_with_the_dense_route(system)


def massless_tip() -> System:
    """Two links; the constants of the outer one lose their mass behind the checks' back."""
    link = {"mass": 1.0, "com": (0.4, 0.0, 0.0), "inertia": (0.1, 0.2, 0.2)}
    scene = (
        SceneBuilder("two links", gravity=(0.0, 0.0, -9.81))
        .rigid_body("inner", **link)
        .rigid_body("outer", **link)
        .revolute("shoulder", "ground", "inner")
        .universal("elbow", "inner", "outer", parent_position=(0.8, 0.0, 0.0))
        .scene()
    )
    system = flexmb.compile(scene)
    unlocked(system.constants).body["rigid"][1] = 0.0
    return system


def test_a_body_that_moves_without_mass_is_named():
    system = massless_tip()
    for ask in (system.accelerations, system.energy, system.hinge_loads):
        with pytest.raises(DynamicsError, match='body "outer" .* give it mass'):
            ask(system.initial_state)
