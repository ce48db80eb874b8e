"""Derivatives of closed chains: motion and loads at one state, and the initial state that closes the closures."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import flexmb
from flexmb.ready import scenes
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.shapes import beam_section
from flexmb.scene.values import with_values
from tests.flexmb.parameters import recompiled

SECTION = beam_section(E=7e10, G=2.7e10, A=1e-4, Iy=1.7e-10, Iz=1.7e-10, rho=2700.0)


def four_bar() -> flexmb.Scene:
    """With unequal sides, a flexible coupler, and a planar closure, which leaves all of its loads determined."""
    builder = SceneBuilder("four-bar", gravity=(0.0, -9.81, 0.0))
    builder.rigid_body("crank", mass=1.0, com=(0.2, 0.0, 0.0), inertia=(1e-3, 1e-2, 1e-2))
    builder.beam("coupler", length=1.1, elements=4, modes=2, level="full", section=SECTION)
    builder.rigid_body("rocker", mass=1.5, com=(0.4, 0.05, 0.0), inertia=(1e-2, 1e-1, 1e-1))
    builder.revolute("motor", "ground", "crank", angle=1.2, rate=2.0, stiffness=3.0, given=True)
    at = {"parent_position": (0.4, 0.0, 0.0), "child_node": "root"}
    builder.revolute("elbow", "crank", "coupler", angle=-1.0, **at)
    builder.revolute("base", "ground", "rocker", angle=1.4, parent_position=(1.0, 0.0, 0.0))
    return builder.closure("pin", "spherical", "coupler", "rocker", node_a="tip", position_b=(0.9, 0.0, 0.0)).scene()


NAMES = [
    "crank.mass_kg", "rocker.com_m.1", "rocker.inertia_kg_m2.2.2", "coupler.stations.0.EIz_Nm2",
    "coupler.stations.0.mass_per_length_kg_m", "motor.rotation.stiffness_Nm_rad", "gravity_m_s2.0",
    "pin.position_b_m.0", "elbow.parent_position_m.0", "base.parent_position_m.1",
]  # fmt: skip


def everything(system, state) -> np.ndarray:
    """Accelerations, then the loads of hinges and closures."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        system.initial_state  # noqa: B018  (it counts the independent rows)
    found = system.closures.motion(state.t, state.y)
    return np.concatenate([found.accelerations, found.hinges.ravel(), found.closures.ravel()])


def test_motion_and_loads_against_recompiled_chains():
    """At one state, where other lengths open the closure: it is accelerated as if the gap were there to stay."""
    scene = four_bar()
    system = flexmb.compile(scene)
    state = system.admissible(system.state(system.initial_state.q, system.initial_state.u))
    p = system.parameters(NAMES)
    rates, loads = p.accelerations(state), p.loads(state)
    known = np.isfinite(np.concatenate([load for load in system.evaluate(0.0, state.q, state.u).loads.values()]))
    mine = np.concatenate([rates, *loads.values()])
    known = np.concatenate([np.ones(system.nu, bool), known])
    np.testing.assert_array_equal(np.isfinite(mine), np.tile(known[:, None], len(NAMES)))
    noticed = 0
    for j, name in enumerate(NAMES):
        value = p.values[j]

        def at(change: float, name=name, value=value) -> np.ndarray:
            return everything(system.with_numbers(with_values(scene, {name: value + change})), state)[known]

        expected, doubt = recompiled.extrapolated(at, 2.0**-5 * (abs(value) or 1.0))
        error = np.max(np.abs(mine[known, j] - expected))
        assert error <= 2.0 * doubt + 1e-11, name
        noticed += np.max(np.abs(1e-6 * mine[known, j])) > 2.0 * doubt
    assert noticed >= 7


def test_the_initial_state_follows_the_closures():
    """The motor's angle and rate are given, and all else follows; systems that are assembled anew find the same."""
    scene = four_bar()
    system = flexmb.compile(scene)
    p = system.parameters(
        ["pin.position_b_m.0", "motor.rotation.angle_rad", "motor.rotation.rate_rad_s", "crank.mass_kg"]
    )
    for j, name in enumerate(p.names):
        value = p.values[j]

        def at(change: float, name=name, value=value) -> np.ndarray:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return flexmb.compile(with_values(scene, {name: value + change})).initial_state.y

        expected, doubt = recompiled.extrapolated(at, 2.0**-6)
        assert np.max(np.abs(p.initial_state[:, j] - expected)) <= 2.0 * doubt + 1e-9, name
    assert np.any(p.initial_state[:, 0]) and np.max(np.abs(p.initial_state[:, 3])) < 1e-11
    assert p.initial_state[system.coordinate("motor"), 1] == pytest.approx(1.0, abs=1e-10)


def test_couplings():
    """A gear: u_2 = r u_1, so that udot_1 = tau / (J_1 + r^2 J_2)."""
    builder = SceneBuilder("gear", gravity=(0.0, 0.0, 0.0))
    for name in ("a", "b"):
        builder.rigid_body(name, mass=1.0, com=(0.0, 0.0, 0.0), inertia=(1.0, 1.0, 2.0))
    builder.revolute("in", "ground", "a", torque=s.Constant(value=3.0)).revolute("out", "ground", "b")
    builder.coupling("gear", "out", {"in": 1.5})
    system = flexmb.compile(builder.scene())
    p = system.parameters(["gear.terms.0.ratio", "b.inertia_kg_m2.2.2", "in.rotation.torque_Nm.value"])
    J = 2.0 + 1.5**2 * 2.0
    a = 3.0 / J
    by_ratio, by_inertia, by_torque = -a * 2 * 1.5 * 2.0 / J, -a * 1.5**2 / J, 1.0 / J
    expected = [[by_ratio, by_inertia, by_torque], [a + 1.5 * by_ratio, 1.5 * by_inertia, 1.5 * by_torque]]
    np.testing.assert_allclose(p.accelerations(system.initial_state), expected, rtol=1e-12)


def test_bodies_of_undeformed_shape_are_refused():
    with pytest.raises(NotImplementedError, match="ruthless"):
        flexmb.compile(scenes.looped_at_rest_shape().scene()).parameters(["bob.mass_kg"])
