"""Connectors by every algorithm against the dense route, which takes them from the schema's definitions."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from flexmb.dense import DenseSystem
from flexmb.scene import schema as s
from tests.bounds import UNIT_ROUNDOFF, algebra, backward_error, gamma
from tests.flexmb.connectors.connected_scenes import everything, started

ALGORITHMS = ("articulated", "composite", "unsplit")
DIGITS = 2.0**10 * UNIT_ROUNDOFF  # of a load: poses of three bodies, a logarithm, a product by a matrix (6,6)


@pytest.fixture(scope="module")
def at_start():
    scene = everything()
    system, state = started(scene)
    return system, state, DenseSystem(scene)


def left_over(dense: DenseSystem, state, rates) -> float:
    """Backward error of accelerations in the dense equations."""
    right = dense.applied(state.q, state.u) - dense.bias(state.q, state.u)
    return backward_error(dense.mass_matrix(state.q), rates, right)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_accelerations_solve_the_dense_equations(at_start, algorithm):
    system, state, dense = at_start
    assert left_over(dense, state, system.accelerations(state, algorithm)) <= gamma(8 * dense.nu)


@pytest.mark.parametrize("algorithm", ["articulated", "frisch"])
@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_of_first_order(algorithm):
    """Frisch's equations are those of level linear."""
    scene = everything(level="linear")
    system, state = started(scene)
    assert left_over(DenseSystem(scene), state, system.accelerations(state, algorithm)) <= gamma(64 * system.nu)


@pytest.mark.parametrize("level", ["rigid", "stiffened"])
@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_at_nodes_of_other_levels(level):
    scene = everything(level=level)
    system, state = started(scene)
    assert left_over(DenseSystem(scene), state, system.accelerations(state)) <= gamma(64 * system.nu)


def test_in_lanes(at_start):
    system, state, dense = at_start
    found = system.accelerations_batch(np.tile(state.q, (9, 1)), np.tile(state.u, (9, 1)))
    assert not len(found.failed)
    assert left_over(dense, state, found.accelerations[3]) <= gamma(8 * dense.nu)


def test_bias_and_applied_loads(at_start):
    system, state, dense = at_start
    for found, expected in (
        (system.bias(state), dense.bias(state.q, state.u)),
        (system.applied(state), dense.applied(state.q, state.u)),
    ):
        assert np.max(np.abs(found - expected)) <= DIGITS * np.max(np.abs(expected))


def test_loads_and_energy(at_start):
    system, state, dense = at_start
    seen, grips = system.evaluate(0.0, state.q, state.u), dense.grips(state.q, state.u)
    assert seen.connectors.keys() == grips.keys()
    for name, load in seen.connectors.items():
        assert np.max(np.abs(load - grips[name].on_b)) <= DIGITS * max(1.0, np.max(np.abs(load)))
    energy = dense.energy(state.q, state.u)
    assert abs(seen.energy["spring"] - energy["spring"]) <= DIGITS * energy["spring"]
    assert not np.any(seen.connectors["slack"])


def test_hinge_loads(at_start):
    """Of all that a hinge carries, connectors to it are no part of its load."""
    system, state, dense = at_start
    rates = system.accelerations(state)
    found, expected = system.hinge_loads(state), dense.hinge_loads(0.0, state.q, state.u, rates)
    bound = algebra(dense.nu, 3, 30) * np.max(np.abs(dense.mass_matrix(state.q)) @ np.abs(rates))
    assert all(np.max(np.abs(found[name] - expected[name])) <= bound for name in expected)


def test_operators_have_the_same_accelerations(at_start):
    system, state, dense = at_start
    found = system.operators(state).accelerations(dense.applied(state.q, state.u))
    assert left_over(dense, state, found) <= gamma(64 * dense.nu)


@pytest.mark.parametrize("name", [connector.name for connector in everything().connectors if connector.name != "slack"])
def test_every_connector_counts(at_start, name):
    """Negative control: the equations of a scene without it are not fulfilled."""
    system, state, dense = at_start
    without = [connector for connector in dense.scene.connectors if connector.name != name]
    other = DenseSystem(msgspec.structs.replace(dense.scene, connectors=tuple(without)))
    assert left_over(other, state, system.accelerations(state)) > 1e3 * gamma(8 * dense.nu)


@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_ruthless_bodies_take_no_connector_where_they_bend():
    with pytest.raises(NotImplementedError, match='connector "spring".*"ruthless".*node "tip"'):
        started(everything(level="ruthless"))


def test_a_function_of_time_drives_an_actuator(at_start):
    """The ram's load less its damper's is its function's value, along the line from A to B."""
    system, state, dense = at_start
    ram = next(connector for connector in dense.scene.connectors if connector.name == "ram")
    assert isinstance(ram.force_N, s.Sine)
    changed = []
    for t in (0.0, 0.7):
        changed.append(np.linalg.norm(system.evaluate(t, state.q, state.u).connectors["ram"][3:]))
    f = [ram.force_N.offset + ram.force_N.amplitude * np.sin(3.0 * t + 0.5) for t in (0.0, 0.7)]
    assert abs(abs(changed[1] - changed[0]) - abs(f[1] - f[0])) <= 1e-12
