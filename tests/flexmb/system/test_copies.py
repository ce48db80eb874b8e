"""Copies and pickles of systems, batches and runs are whole; and kernels write nowhere but into their arrays."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

import flexmb as fm
from flexmb.entry import articulated
from flexmb.jit.bundle import bundle
from tests.flexmb.closure.mechanisms import bennett
from tests.flexmb.connectors.connected_scenes import everything
from tests.flexmb.control.scenes import pendulum
from tests.trees import random_scene

WAYS = {"copy": copy.copy, "deepcopy": copy.deepcopy, "pickle": lambda x: pickle.loads(pickle.dumps(x))}
GUARD = 0xAB
AROUND = 1024  # bytes on either side: rows of eight floats, and more


def rigid() -> fm.Scene:
    """Two bodies without modes, whose tables over modes have no columns."""
    builder = fm.SceneBuilder("rigid").rigid_body("a", mass=1.0, inertia=(1, 1, 1)).free("flight", "ground", "a")
    builder.rigid_body("b", mass=1.0, com=(0.3, 0, 0), inertia=(1, 1, 1)).revolute("pivot", "a", "b", rate=1.0)
    return builder.marker("tip", "b").scene()


def controlled() -> fm.Scene:
    """A pendulum with a controller, whose runs write into functions of time."""
    law = fm.Pid(name="law", inputs=("angle",), kp=-2.0, period_s=0.1)
    return pendulum(law, torque=fm.ControlSignal(source="law")).scene()


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("made", [everything, rigid, bennett, controlled], ids=lambda made: made.__name__)
@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_a_copy_of_a_used_system_is_a_system(made: Any, way: str) -> None:
    """Asked at another state than the original was last, so that what it remembers is not what is asked."""
    system = fm.compile(made())
    fm.simulate(system, 0.01, samples=3)
    copied = WAYS[way](system)
    assert type(copied) is type(system) and copied.scene == system.scene and not copied.kept
    late = fm.simulate(system, 0.02, samples=3)
    for q, u in zip(late.q, late.u, strict=True):
        expected, found = system.evaluate(0.0, q, u), copied.evaluate(0.0, q, u)
        assert found.energy == expected.energy
        assert np.array_equal(found.accelerations, expected.accelerations)
    assert np.array_equal(fm.simulate(copied, 0.02, samples=3).q, late.q)


def test_batches_and_runs_too() -> None:
    scenes = [random_scene(5)] * 3
    batch = fm.compile_batch(scenes)
    q, u = batch.initial_states()
    expected = batch.accelerations(q, u).accelerations
    for way in WAYS.values():
        assert np.array_equal(way(batch).accelerations(q, u).accelerations, expected)
    run = fm.simulate(scenes[0], 0.01, samples=3)
    copied = pickle.loads(pickle.dumps(run))
    assert np.array_equal(copied.q, run.q) and copied.restart is not None
    assert copied.error_estimate().keys() == run.error_estimate().keys()


@bundle
class Halves:
    """Two arrays that are parts of one."""

    first: np.ndarray
    second: np.ndarray


def test_arrays_that_are_parts_of_one_are_not_copied() -> None:
    both = np.zeros(4)
    with pytest.raises(TypeError, match="Halves cannot be copied"):
        copy.deepcopy(Halves(both[:2], both[2:]))
    with pytest.raises(TypeError, match="Outputs cannot be copied"):
        copy.deepcopy(fm.compile(rigid()).observation.out)


def guarded(bundled: Any, rooms: dict[str, np.ndarray]) -> Any:
    """The same bundle with each array in the middle of a larger one, whose other bytes are known."""
    moved = {}
    for field in fields(bundled):
        array = getattr(bundled, field.name)
        room = np.full(array.nbytes + 2 * AROUND, GUARD, np.uint8)
        rooms[field.name] = room
        # an empty view of the room would begin where the room does
        place = np.ndarray(array.shape, array.dtype, room, AROUND)
        place[...] = array
        moved[field.name] = place
    return type(bundled)(**moved)


@pytest.mark.parametrize("scene", [rigid(), everything(), random_scene(5)], ids=["rigid", "connected", "random"])
@pytest.mark.filterwarnings("ignore:.*is doubtful")
def test_kernels_write_into_their_arrays_only(scene: fm.Scene) -> None:
    system = fm.compile(scene, "explicit")
    rooms: dict[str, np.ndarray] = {}
    w = guarded(system.workspace(), rooms)
    y, dy = system.initial_state.y, np.empty(system.nq + system.nu + 1)
    assert articulated.rhs(0.0, y, dy, system.constants, w) == fm.Status.OK
    trespassed = {
        name for name, room in rooms.items() if np.any(room[:AROUND] != GUARD) or np.any(room[-AROUND:] != GUARD)
    }
    assert not trespassed


USED = """
import copy, gc, pickle
import flexmb as fm
from tests.flexmb.system import test_copies as scenes

for made in (scenes.rigid, scenes.bennett, scenes.controlled):
    system = fm.compile(made())
    for way in (copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))):
        fm.simulate(system, 0.01, samples=3)
        system = way(system)
        state = system.initial_state
        system.evaluate(0.0, state.q, state.u)
        gc.collect()
print("sound")
"""


def test_the_heap_is_sound_after_all_that() -> None:
    """In a process whose allocator looks for what was overwritten at every free."""
    strict = os.environ | {"MALLOC_CHECK_": "3", "MALLOC_PERTURB_": "165", "PYTHONMALLOC": "malloc"}
    done = subprocess.run([sys.executable, "-c", USED], env=strict, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0 and done.stdout.strip() == "sound", done.stderr[-2000:]
