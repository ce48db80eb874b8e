"""The compiled recursion and the dense route agree to round-off on random trees: two different sets of equations.

Every comparison is made in the size of the terms that were summed: mass times |Jacobian| |rates| for whatever an
acceleration enters, as stiff modes make large accelerations that cancel in loads.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import flexmb
from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions, member_frames, point_frames
from flexmb.dense.jets import profile
from tests import trees
from tests.bounds import algebra, backward_error, gamma

RECIPES = {
    "rigid": trees.RIGID, "full": trees.FULL, "ruthless": trees.RUTHLESS, "mixed": trees.MIXED,
    "linear": trees.LINEAR, "stiffened": trees.STIFFENED, "every level": trees.EVERY_LEVEL,
    "free-flying": trees.FREE_FLYING, "conservative": trees.CONSERVATIVE, "later kinds": trees.LATER,
    "armatures": trees.ARMED, "exact": trees.EXACT, "coupled sections": trees.BLADES,
}  # fmt: skip
CASES = [*((name, 0) for name in RECIPES), *(pytest.param((name, 1), marks=pytest.mark.slow) for name in RECIPES)]


@dataclass(frozen=True)
class Pair:
    """Both routes at the scene's own random state, and the bound of their difference."""

    system: flexmb.System
    dense: DenseSystem
    state: flexmb.State
    rates: np.ndarray
    bound: float
    inertia: float  # size of the inertia forces and torques before they cancel
    M: np.ndarray
    bias: np.ndarray


@pytest.fixture(scope="module", params=CASES, ids=str)
def pair(request) -> Pair:
    name, seed = request.param
    scene = trees.random_scene(seed, RECIPES[name])
    system, dense = flexmb.compile(scene), DenseSystem(scene)
    state = system.initial_state
    rates = system.accelerations(state)
    largest = max(len(member.model.mass) for member in dense.tree.members)
    bound = algebra(dense.nu, len(dense.tree.members), largest)
    M, bias = dense.mass_matrix(state.q), dense.bias(state.q, state.u)
    return Pair(system, dense, state, rates, bound, _inertia(dense, state, rates), M, bias)


def _inertia(dense: DenseSystem, state: flexmb.State, rates: np.ndarray) -> float:
    """sum over points of m (|J| |rates| + |bias acceleration|) times the arm they can have about any hinge."""
    unit = Motions(state.q, np.eye(dense.nu), np.zeros((dense.nu, dense.nu)))
    moving = Motions(state.q, state.u[None], np.zeros((1, dense.nu)))
    velocities = point_frames(dense.tree, member_frames(dense.tree, unit), unit)
    bias = point_frames(dense.tree, member_frames(dense.tree, moving), moving).first.position
    linear = np.einsum("jpa,j->p", np.abs(np.broadcast_to(velocities.position.rate, (dense.nu, *bias.value.shape))),
                       np.abs(rates))  # fmt: skip
    arm = 1.0 + 2.0 * np.max(np.abs(bias.value))
    return float(arm * dense.points.mass @ (linear + np.linalg.norm(bias.acceleration, axis=1) + 10.0))


def close(found, expected, size, bound) -> bool:
    return bool(np.max(np.abs(np.asarray(found) - np.asarray(expected)), initial=0.0) <= bound * size)


def test_mass_matrix(pair):
    assert close(pair.system.mass_matrix(pair.state), pair.M, np.max(np.abs(pair.M)), pair.bound)


def test_bias_and_applied_forces(pair):
    q, u = pair.state.q, pair.state.u
    assert close(pair.system.bias(pair.state), pair.bias, np.max(np.abs(pair.bias)), pair.bound)
    applied = pair.dense.applied(q, u)
    assert close(pair.system.applied(pair.state), applied, np.max(np.abs(applied), initial=0.0), pair.bound)


def test_accelerations_solve_the_dense_equations(pair):
    """Backward error within n u: no other measure is fair to an ill-conditioned mass matrix."""
    free = np.ones(pair.dense.nu, dtype=bool)
    free[[x.u for x in pair.dense.tree.scalars if x.prescribed is not None]] = False
    right = pair.dense.applied(pair.state.q, pair.state.u) - pair.bias
    assert backward_error(pair.M[free], pair.rates, right[free]) <= gamma(pair.dense.nu)


def test_prescribed_speeds_have_the_rates_of_their_functions(pair):
    for x in pair.dense.tree.scalars:
        if x.prescribed is not None:
            expected = profile(x.prescribed, 0.0).acceleration
            assert close(pair.rates[x.u], expected, abs(expected), pair.bound)


def test_drives(pair):
    q, u, rates = pair.state.q, pair.state.u, pair.rates
    found = pair.system.evaluate(0.0, q, u).drives
    expected = pair.dense.drives(0.0, q, u, rates)
    assert found.keys() == expected.keys()
    size = np.max(np.abs(pair.M) @ np.abs(rates) + np.abs(pair.bias))
    assert all(close(found[name], expected[name], size, pair.bound) for name in expected)


def test_hinge_and_wheel_loads(pair):
    q, u = pair.state.q, pair.state.u
    found = pair.system.evaluate(0.0, q, u)
    for ours, theirs in (
        (found.loads, pair.dense.hinge_loads(0.0, q, u, pair.rates)),
        (found.wheel_loads, pair.dense.wheel_loads(0.0, q, u, pair.rates)),
    ):
        assert ours.keys() == theirs.keys()
        assert all(close(ours[name], theirs[name], pair.inertia, pair.bound) for name in theirs)


def test_markers(pair):
    q, u = pair.state.q, pair.state.u
    found = pair.system.evaluate(0.0, q, u).markers
    expected = pair.dense.markers(0.0, q, u, pair.rates)
    fastest = max(np.max(np.abs(m.acceleration)) for m in expected.values())
    largest = max(1.0, *(np.max(np.abs(m.position)) for m in expected.values()))
    for name, marker in expected.items():
        assert close(found[name].position, marker.position, largest, pair.bound)
        assert close(found[name].rotation, marker.rotation, 1.0, pair.bound)
        assert close(found[name].velocity, marker.velocity, fastest, pair.bound)
        assert close(found[name].acceleration, marker.acceleration, pair.inertia + fastest, pair.bound)


def test_energy_and_momentum(pair):
    q, u = pair.state.q, pair.state.u
    energy = pair.dense.energy(q, u)
    total = sum(abs(value) for value in energy.values())
    assert all(close(pair.system.energy(pair.state)[kind], value, total, pair.bound) for kind, value in energy.items())
    momentum = pair.dense.momentum(q, u)
    assert close(pair.system.momentum(pair.state), momentum, np.max(np.abs(momentum)), pair.bound)


def test_kinetic_energy_is_the_quadratic_form_of_the_mass_matrix(pair):
    M, u = pair.system.mass_matrix(pair.state), pair.state.u
    kinetic = pair.dense.energy(pair.state.q, u)["kinetic"]
    assert close(kinetic, 0.5 * u @ M @ u, 0.5 * abs(u) @ abs(M) @ abs(u), pair.bound)
