"""A compiled scene: names and places, what it refuses, and the same numbers interpreted as compiled."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexmb
from flexmb.scene import schema as s
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Sine
from flexmb.system.system import System
from tests import trees
from tests.bounds import algebra, relative

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


def test_one_evaluation_leaves_nothing_behind_for_the_next(system):
    """The workspace is overwritten, never accumulated into."""
    state = system.initial_state
    first = system.accelerations(state)
    other = system.state(state.q, state.u + 1.0)
    system.mass_matrix(other), system.bias(other), system.evaluate(0.0, other.q, other.u)
    assert np.array_equal(system.accelerations(state), first)


# Without the compiler records have no attributes: `Rows` and `Row` give them some. The statements are the kernels' own.
INTERPRETED = """
import sys
from dataclasses import fields, replace
from types import SimpleNamespace
import numba
import numpy as np
import flexmb.jit.direct as direct
import flexmb.jit.kernel as making

making.HOOKS = replace(making.HOOKS, keep=lambda compiled, function: None)
numba.config.DISABLE_JIT = 1  # from here on: the package refuses to be without its compiler
def addresses(function, returned, *given):
    return function, *(each for each in given if not isinstance(each, numba.types.Type))

direct.addresses = addresses
direct.settled = lambda function, *kinds: function
import flexmb
from tests.flexmb.system.test_system import RECIPE, SEED, numbers
from tests.trees import random_scene

class Row:
    def __init__(self, record):
        object.__setattr__(self, "record", record)
    def __getattr__(self, name):
        return self.record[name]
    def __getitem__(self, name):
        return self.record[name]
    def __setattr__(self, name, value):
        self.record[name] = value

class Rows:
    def __init__(self, array):
        self.array, self.shape = array, array.shape
    def __len__(self):
        return len(self.array)
    def __getitem__(self, key):
        found = self.array[key]
        if isinstance(found, np.void):
            return Row(found)
        return Rows(found) if found.dtype.names else found

def records(bundle):
    arrays = {field.name: getattr(bundle, field.name) for field in fields(bundle)}
    named = {name: Rows(array) if array.dtype.names else array for name, array in arrays.items()}
    return SimpleNamespace(_numba_type_=bundle._numba_type_, **named)

system = flexmb.compile(random_scene(SEED, RECIPE))
system.constants = system.recursion_constants = records(system.constants)
system.own_workspace = system.own_recursion_workspace = records(system.own_workspace)
np.save(sys.argv[1], numbers(system))
"""


def numbers(system: System) -> np.ndarray:
    """Everything one evaluation gives, each part in units of its largest entry."""
    state = system.initial_state
    seen = system.evaluate(state.t, state.q, state.u)
    motions = [np.concatenate([m.position, m.velocity]) for m in seen.markers.values()]
    parts = [
        system.mass_matrix(state), system.bias(state), seen.accelerations, np.array(list(seen.energy.values())),
        seen.momentum, np.array(list(seen.loads.values())), np.array(motions),
    ]  # fmt: skip
    return np.concatenate([np.ravel(part) / np.max(np.abs(part)) for part in parts])


def test_interpreted_equals_compiled(system, tmp_path):
    """The compiler fuses products and sums, so the last digits may differ, and nothing else."""
    root = Path(__file__).parents[3]
    paths = os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])
    subprocess.run(
        [sys.executable, "-c", INTERPRETED, str(tmp_path / "numbers.npy")], check=True, cwd=root,
        env=os.environ | {"PYTHONPATH": paths},
    )  # fmt: skip
    condition = np.linalg.cond(system.mass_matrix(system.initial_state))
    bound = algebra(system.nu, len(system.body_names), 15)
    assert relative(np.load(tmp_path / "numbers.npy"), numbers(system)) <= bound * condition
