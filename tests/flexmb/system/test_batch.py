"""Accelerations of many copies in lanes, against the system of each copy alone."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.build import SceneBuilder
from flexmb.system.batch import Batch
from flexmb.system.compile import compile_batch
from tests import trees
from tests.bounds import backward_error

BOUND = 8 * 2.0**-52  # ulps of the largest term
RECIPES = {
    "rigid": trees.RIGID,
    "full": trees.FULL,
    "ruthless": trees.RUTHLESS,
    "linear": trees.LINEAR,
    "stiffened": trees.STIFFENED, "exact": trees.EXACT,
    "every level": trees.EVERY_LEVEL,
    "conservative": trees.CONSERVATIVE,
    "free": trees.FREE_FLYING,
    "armatures": trees.ARMED,
}


def states(system: fm.System, n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Around the initial state, at times before, in and after what functions of time do."""
    rng, start = np.random.default_rng(seed), system.initial_state
    q = start.q + 0.02 * rng.standard_normal((n, system.nq))
    u = start.u + 0.1 * rng.standard_normal((n, system.nu))
    return q, u, rng.uniform(-0.7, 3.0, n)


def error(system: fm.System, state: fm.State, found: np.ndarray) -> float:
    """Backward error of accelerations against those of the system alone."""
    M = system.mass_matrix(state)
    return backward_error(M, found, M @ system.accelerations(state))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("recipe", RECIPES)
def test_lanes_are_the_system_alone(recipe, seed):
    """Random trees of all hinges, with wheels, loads, springs, functions and prescribed motion."""
    system = fm.compile(trees.random_scene(seed, RECIPES[recipe]), "explicit")
    q, u, t = states(system, 11, seed)
    found = system.accelerations_batch(q, u, t, threads=1)
    for row, status, *state in zip(*found, q, u, t, strict=True):
        state = system.state(*state)
        if status != fm.Status.OK:
            assert np.isnan(row).all()
            with pytest.raises(fm.DynamicsError) as caught:
                system.accelerations(state)
            assert caught.value.status == status
        else:
            assert error(system, state, row) <= BOUND


def test_a_lane_of_another_copy_is_noticed():
    """Negative control: the bound tells the copies from each other."""
    system = fm.compile(trees.random_scene(0, trees.RIGID))
    q, u, t = states(system, 8)
    found = system.accelerations_batch(q, u, t)
    state = system.state(q[3], u[3], t[3])
    assert error(system, state, found.accelerations[3]) <= BOUND
    assert error(system, state, found.accelerations[4]) > 1e3 * BOUND


@pytest.fixture(scope="module")
def chain() -> fm.System:
    return fm.compile(trees.random_scene(1, trees.RIGID))


@pytest.mark.parametrize("n", [0, 1, 7, 8, 9, 24, 25])
def test_any_number_of_copies(chain, n):
    q, u, t = states(chain, n)
    found = chain.accelerations_batch(q, u, t)
    assert found.accelerations.shape == (n, chain.nu)
    assert found.status.shape == (n,)
    whole = chain.accelerations_batch(*(np.concatenate([part, part]) for part in (q, u, t))).accelerations
    np.testing.assert_array_equal(found.accelerations, whole[:n])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
def test_a_copy_that_is_not_finite_fails_alone(chain, bad):
    q, u, t = states(chain, 20)
    right = chain.accelerations_batch(q, u, t)
    u[13, 2] = bad
    found = chain.accelerations_batch(q, u, t)
    assert found.failed.tolist() == [13]
    assert found.status[13] == fm.Status.NONFINITE
    others = np.arange(20) != 13
    np.testing.assert_array_equal(found.accelerations[others], right.accelerations[others])
    assert np.isnan(found.accelerations[13]).all()


def test_a_copy_at_no_time_fails_alone():
    """Of a scene that does not depend on time, too."""
    system = fm.compile(gimbal())
    q, u, t = states(system, 9)
    t[4] = np.nan
    assert system.accelerations_batch(q, u, t).failed.tolist() == [4]


def gimbal() -> fm.Scene:
    """A body without inertia about the axis that is lost where the middle angle is a right one."""
    scene = SceneBuilder("gimbal")
    scene.rigid_body("rod", mass=1.0, com=(0.0, 0.0, 0.0), inertia=np.diag([1.0, 1.0, 1.0]))
    angles = tuple(fm.AngularCoordinate(angle_rad=a) for a in (0.1, 0.4, 0.2))
    scene.add(fm.Gimbal(name="g", parent="ground", child="rod", sequence="xyz", rotations=angles))
    return scene.scene()


def test_a_copy_at_a_singular_angle_fails_alone():
    system = fm.compile(gimbal())
    q, u, _ = states(system, 8)
    q[5, 1] = 0.5 * np.pi
    found = system.accelerations_batch(q, u)
    assert found.failed.tolist() == [5]
    assert found.status[5] == fm.Status.NOT_POSITIVE_DEFINITE
    for i in (4, 6):
        state = system.state(q[i], u[i])
        assert error(system, state, found.accelerations[i]) <= BOUND


def test_a_copy_beyond_the_range_of_its_modes_fails_alone():
    system = fm.compile(trees.random_scene(0, trees.FULL), "explicit")
    q, u, t = states(system, 8)
    beam = next(body.name for body in system.scene.bodies if isinstance(body, fm.BeamBody))
    place = system.coordinate(f"{beam}.modes")
    q[2, place] = 1e4
    found = system.accelerations_batch(q, u, t)
    assert found.failed.tolist() == [2]
    with pytest.raises(fm.DynamicsError) as caught:
        system.accelerations(system.state(q[2], u[2], t[2]))
    assert found.status[2] == caught.value.status == fm.Status.OUT_OF_RANGE


def varied(seed: int, recipe: trees.Recipe, n: int) -> list[fm.Scene]:
    """Scenes of one structure whose numbers all differ by up to a tenth."""
    scene = trees.random_scene(seed, recipe)
    return [scene, *(msgspec.convert(_scaled(msgspec.to_builtins(scene), i), fm.Scene) for i in range(1, n))]


_NUMBERS = {
    "mass_kg", "inertia_kg_m2", "gravity_m_s2", "parent_position_m", "child_position_m", "com_m", "angle_rad",
    "rate_rad_s", "stiffness_Nm_rad", "damping_Nms_rad", "stiffness_N_m", "damping_Ns_m", "rest_angle_rad", "amplitude",
    "end_value", "duration_s", "axial_inertia_kg_m2", "transverse_inertia_kg_m2", "armature_kg_m2", "armature_kg",
}  # fmt: skip


def _scaled(value, i):
    """A tree of plain values whose numbers of these names are multiplied by 1 + i / 100."""
    factor = 1.0 + 0.01 * i
    if isinstance(value, dict):
        return {
            key: _times(each, factor) if key in _NUMBERS else _scaled(each, i)
            for key, each in value.items()
        }
    return [_scaled(each, i) for each in value] if isinstance(value, list | tuple) else value


def _times(value, factor):
    return [_times(each, factor) for each in value] if isinstance(value, list | tuple) else factor * value


@pytest.mark.parametrize("recipe", ["rigid", "full", "every level", "armatures"])
def test_copies_with_numbers_of_their_own(recipe):
    scenes = varied(3, RECIPES[recipe], 11)
    batch = compile_batch(scenes)
    assert not batch.shares_constants
    q, u = batch.initial_states()
    found = batch.accelerations(q, u, 0.4, threads=1)
    assert len(np.unique(found.accelerations[:, 0])) == 11
    for i, scene in enumerate(scenes):
        system = fm.compile(scene, "explicit")
        assert error(system, system.state(q[i], u[i], 0.4), found.accelerations[i]) <= BOUND


@pytest.mark.parametrize("damped", [range(8, 11), range(8)])
def test_what_only_some_copies_have(damped, monkeypatch):
    """Kernels without dampers are for blocks of copies that have none."""
    monkeypatch.setenv("FLEXMB_KERNELS", "exact")
    scenes = [pendulum(0.3 if i in damped else 0.0) for i in range(11)]
    q, u = np.zeros((11, 1)), np.ones((11, 1))
    found = compile_batch(scenes).accelerations(q, u, threads=1).accelerations[:, 0]
    alone = [float(fm.compile(scene).accelerations(fm.compile(scene).state([0.0], [1.0]))[0]) for scene in scenes]
    np.testing.assert_array_equal(found, alone)
    assert len(set(alone)) == 2


def pendulum(damping: float) -> fm.Scene:
    scene = SceneBuilder("pendulum").rigid_body("rod", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    return scene.revolute("pin", "ground", "rod", damping=damping).scene()


def test_copies_of_another_structure_are_refused():
    scene = gimbal()
    other = replace_hinge(scene)
    with pytest.raises(ValueError, match="scene 1 has another structure"):
        compile_batch([scene, other])
    with pytest.raises(ValueError, match="scene 2 has another structure"):
        compile_batch([scene, scene, trees.random_scene(0, trees.RIGID)])
    with pytest.raises(ValueError, match="at least one"):
        compile_batch([])
    assert len(compile_batch(each for each in [scene, scene]).systems) == 2
    with pytest.raises(TypeError, match="list"):
        compile_batch(scene)
    with pytest.raises(ValueError, match="scene 1 has another structure"):
        Batch([fm.compile(scene), fm.compile(other)])


def replace_hinge(scene: fm.Scene) -> fm.Scene:
    """The same names, another sequence of axes."""
    [hinge] = scene.hinges
    return msgspec.structs.replace(scene, hinges=(msgspec.structs.replace(hinge, sequence="zyx"),))
