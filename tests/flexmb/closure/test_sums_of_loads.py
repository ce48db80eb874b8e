"""Loads of redundant joints: sums that the motion determines, and one named choice of those that it does not."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm

WEIGHT = 2.0 * 9.81


@pytest.fixture(scope="module")
def door() -> fm.System:
    """A door on two hinges in one line, the upper one a closure from the other side: it swings about that line."""
    tree = fm.SceneBuilder("door", gravity=(0.0, 0.0, -9.81))
    tree.rigid_body("door", mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.2, 0.3), nodes={"top": (0.0, 0.0, 1.0)})
    tree.revolute("lower", "ground", "door", angle=0.4, rate=1.5)
    tree.closure("upper", "revolute", "door", "ground", node_a="top", position_b=(0.0, 0.0, 1.0))
    return fm.compile(tree.marker("edge", "door").scene(), kernels="general")


def test_a_sum_over_parallel_pins_is_determined(door: fm.System) -> None:
    """Before, nothing gave how two pins carry a weight together, as how they share it is open."""
    state = door.initial_state
    each = door.hinge_loads(state)
    assert np.isnan(each["lower"][5]) and np.isnan(each["upper"][5])
    total = door.total_load(state, ["lower", "upper"], "door")
    centre = 0.5 * np.array([np.cos(0.4), np.sin(0.4), 0.0])
    assert np.allclose(total[3:], [*(-2.0 * 1.5**2 * centre[:2]), WEIGHT], rtol=1e-12, atol=1e-12)
    assert np.allclose(total[:3], WEIGHT * np.cross(centre, [0.0, 0.0, 1.0]), rtol=1e-12, atol=1e-12)
    on_ground = door.total_load(state, ["upper", "lower"], "ground", about=("door", "origin"))
    assert np.allclose(on_ground, -total, rtol=1e-12, atol=1e-12)
    alone = door.total_load(state, ["lower"], "door")
    assert np.array_equal(np.isnan(alone), np.isnan(each["lower"]))


def test_least_norm_is_one_choice_with_the_same_sum(door: fm.System) -> None:
    state = door.initial_state
    split, known = door.hinge_loads(state, redundant="least_norm"), door.determined_loads(state)
    assert all(np.all(np.isfinite(load)) for load in split.values())
    for name, load in door.hinge_loads(state).items():
        assert np.array_equal(load[known[name]], split[name][known[name]])
    apart = door.hinge_loads(state, about=("door", "origin"), redundant="least_norm")
    total = door.total_load(state, ["lower", "upper"], "door")
    assert np.allclose(apart["lower"] - apart["upper"], total, rtol=1e-12, atol=1e-12)


def test_a_tree_sums_too() -> None:
    tree = fm.SceneBuilder("pair", gravity=(0.0, 0.0, -9.81))
    for name in ("one", "two"):
        tree.rigid_body(name, mass=1.0, com=(0.1, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    tree.weld("root", "ground", "one").revolute("knee", "one", "two", axis=(0.0, 0.0, 1.0), rate=2.0)
    system = fm.compile(tree.scene(), kernels="general")
    total = system.total_load(system.initial_state, ["root", "knee"], "one")
    assert np.allclose(total, [0.0, -0.981, 0.0, 0.0, 0.0, 9.81], rtol=1e-12, atol=1e-12)  # its own weight


@pytest.mark.parametrize(
    ("joints", "on", "why"),
    [
        (["lower", "lower"], "door", "each once"), ([], "door", "each once"), ("lower", "door", "each once"),
        (["middle"], "door", "there is no hinge or closure"), (["lower"], "wall", "its load on 'wall' is none"),
    ],
)  # fmt: skip
def test_what_is_no_sum_is_refused(door: fm.System, joints: list[str], on: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        door.total_load(door.initial_state, joints, on)
    with pytest.raises(ValueError, match="redundant"):
        door.hinge_loads(door.initial_state, redundant="guess")  # type: ignore[arg-type]
