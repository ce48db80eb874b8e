"""A compiled scene: names and places, what it refuses, and the same numbers interpreted as compiled."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flexmb
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Sine
from flexmb.system.system import System
from tests import trees
from tests.bounds import algebra

RECIPE = replace(trees.MIXED, bodies=5)
SEED = 50


@pytest.fixture(scope="module")
def scene() -> s.Scene:
    return trees.random_scene(SEED, RECIPE)


@pytest.fixture(scope="module")
def system(scene) -> System:
    return flexmb.compile(scene)


def places(system: System, place) -> np.ndarray:
    """How often each entry is named: by hinges, point masses, wheels and modes."""
    scene = system.scene
    names = [x.name for x in (*scene.hinges, *scene.wheels, *scene.point_masses)]
    names += [f"{body.name}.modes" for body in scene.bodies]
    size = system.nq if place == system.coordinate else system.nu
    count = np.zeros(size, dtype=int)
    for name in names:
        count[place(name)] += 1
    return count


def rounding_of_loads(system: System, state, rates: np.ndarray) -> float:
    """Of hinge loads: sums in which modal inertia and elastic forces cancel; rounding is relative to those terms."""
    terms = np.max(np.abs(system.mass_matrix(state)) @ np.abs(rates) + np.abs(system.bias(state)))
    return algebra(system.nu, depth=len(system.body_names)) * terms


def test_every_coordinate_and_speed_has_one_name(system):
    assert np.all(places(system, system.coordinate) == 1)
    assert np.all(places(system, system.speed) == 1)
    for hinge in system.scene.hinges:
        assert system.coordinate(hinge.name) == system.coordinate(f"{hinge.child}.hinge")
        assert system.speed(hinge.name) == system.speed(f"{hinge.child}.hinge")


def test_an_unknown_name_is_answered_with_the_known_ones(system):
    with pytest.raises(KeyError, match="elbow.*b0.hinge"):
        system.coordinate("elbow")


def test_initial_state_holds_the_scenes_values():
    spin = Sine(amplitude=0.5, angular_frequency_rad_s=2.0, phase_rad=0.3)
    body = {"mass": 1.0, "inertia": (0.1, 0.2, 0.2)}
    scene = (
        SceneBuilder("initial").rigid_body("a", **body).rigid_body("b", **body)
        .free("float", "ground", "a", position=(1, 2, 3), quaternion=(0.6, 0, 0.8, 0), angular_velocity=(4, 5, 6),
              velocity=(7, 8, 9))
        .revolute("turn", "a", "b", prescribed=spin)
        .wheel("wheel", "b", axis=(0, 0, 1), axial_inertia=0.1, transverse_inertia=0.06, mass=0.1, angle=0.2,
               speed=30.0).scene()
    )  # fmt: skip
    system = flexmb.compile(scene)
    state = system.initial_state
    assert state.q == pytest.approx([1, 2, 3, 0.6, 0, 0.8, 0, 0.5 * np.sin(0.3), 0.2])
    assert state.u == pytest.approx([4, 5, 6, 7, 8, 9, np.cos(0.3), 30.0])


@pytest.mark.parametrize("levels", [("full",), ("linear",), ("linear", "full", "ruthless", "rigid")], ids="-".join)
def test_hinge_loads_by_inverse_dynamics_are_those_of_the_recursion(levels):
    """Two routes: P_R alpha + z_R outward, and M alpha + b summed inward for the accelerations given."""
    system = flexmb.compile(trees.random_scene(SEED, replace(RECIPE, levels=levels, deformation=0.03)))
    state = system.initial_state
    rates = system.accelerations(state)
    ours, forced = system.hinge_loads(state), system.hinge_loads(state, rates)
    elsewhere = system.hinge_loads(state, rates + 1.0)
    bound = rounding_of_loads(system, state, rates)
    assert max(np.max(np.abs(ours[name] - forced[name])) for name in ours) <= bound
    assert max(np.max(np.abs(ours[name] - elsewhere[name])) for name in ours) > 1e3 * bound


def test_evaluation_repeats_the_single_questions(system):
    state = system.initial_state
    seen = system.evaluate(state.t, state.q, state.u)
    assert np.array_equal(seen.accelerations, system.accelerations(state))
    assert seen.energy == system.energy(state)
    assert np.array_equal(seen.momentum, system.momentum(state))
    loads = system.hinge_loads(state)
    assert [*loads] == [*seen.loads]
    assert {*loads} == {x.name for x in (*system.scene.hinges, *system.scene.point_masses)}
    bound = rounding_of_loads(system, state, seen.accelerations)
    assert max(np.max(np.abs(loads[name] - seen.loads[name])) for name in loads) <= bound
    assert set(seen.wheel_loads) == {wheel.name for wheel in system.scene.wheels}
    for marker in seen.markers.values():
        assert np.linalg.det(marker.rotation) == pytest.approx(1.0)
        assert np.linalg.norm(marker.quaternion) == pytest.approx(1.0)
