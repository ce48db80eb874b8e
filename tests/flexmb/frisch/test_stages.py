"""The paper's three stages: rigid bodies only; flexible ones with hinges at nodes that do not deform; all partitions.

Null partitions of (126) are skipped by flags made from the scene. What is skipped must be worth nothing: with
every
partition kept, the results are the same to the last bit where only zeros are added, and to rounding otherwise.

Whole runs in both routes have the same trajectory to the integrator's tolerance."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.frisch.nested_system import nested_system
from flexmb.scene import schema as s
from tests import trees
from tests.bounds import algebra
from tests.flexmb.frisch.scenes import CLAMPED, at_level, clamped, packed, random_scene
from tests.flexmb.frisch.test_errata import terminal_beams
from tests.repo.project import ROOT
from tests.unlocked import unlocked


def undeforming(scene: s.Scene) -> s.Scene:
    """Every hinge and wheel moved to a node of its parent that does not deform."""
    roots = {body.name: "root" if isinstance(body, s.BeamBody) else "origin" for body in scene.bodies}
    roots["ground"] = "origin"
    hinges = tuple(msgspec.structs.replace(hinge, parent_node=roots[hinge.parent]) for hinge in scene.hinges)
    wheels = tuple(msgspec.structs.replace(wheel, node=roots[wheel.body]) for wheel in scene.wheels)
    masses = tuple(msgspec.structs.replace(mass, node=roots[mass.body]) for mass in scene.point_masses)
    return msgspec.structs.replace(scene, hinges=hinges, wheels=wheels, point_masses=masses)


STAGES = {
    "rigid": random_scene(0, trees.RIGID),
    "undeformed hinges": undeforming(clamped(random_scene(0, CLAMPED))),
    "hub with beams": terminal_beams(),
    "all": clamped(random_scene(0, CLAMPED)),
}


@pytest.mark.parametrize("name", STAGES)
def test_null_partitions_are_worth_nothing(name):
    """(126), (136): skipped or computed, the same equations and the same motion."""
    skipped, kept = nested_system(STAGES[name]), nested_system(STAGES[name], null_partitions=True)
    y = _start(STAGES[name])
    (M, right), (M_kept, right_kept) = skipped.reduced(0.0, y), kept.reduced(0.0, y)
    bound = algebra(len(M), len(skipped.constants.body), 1)
    assert np.max(np.abs(M - M_kept)) <= bound * np.max(np.abs(M))
    assert np.max(np.abs(right - right_kept)) <= bound * np.max(np.abs(right))
    (_, one), (_, other) = skipped.motion(0.0, y), kept.motion(0.0, y)
    size = np.max(np.abs(M) @ np.abs(one.accelerations))
    assert np.max(np.abs(M @ (one.accelerations - other.accelerations))) <= bound * size
    assert np.max(np.abs(one.loads - other.loads)) <= bound * (size + np.max(np.abs(one.loads)))


def entries(name: str, null_partitions: bool) -> int:
    """How many entries S has beyond those of (133)."""
    column = nested_system(STAGES[name], null_partitions=null_partitions).constants.column
    return int(np.sum(column["stop"] - column["own"]))


def test_flags_see_which_partitions_are_null():
    """Stages one and two have no modal partitions at all; without flags stage two would compute them."""
    assert entries("rigid", False) == entries("rigid", True) == 0
    assert entries("undeformed hinges", False) == entries("hub with beams", False) == 0
    assert entries("undeformed hinges", True) > 0
    assert entries("all", True) > entries("all", False) > 0


def test_a_partition_that_is_not_null_is_missed():
    """Negative control: dropping phiT_H of one hinge of the third stage is seen."""
    nested = nested_system(STAGES["all"])
    y = _start(STAGES["all"])
    M, _ = nested.reduced(0.0, y)
    child = int(np.argmax(nested.constants.element["inboard_entry"] >= 0))
    port = nested.constants.body["inboard_port"][child]
    unlocked(nested.constants).port_mode[port, 3:] = 0.0
    assert np.max(np.abs(nested.reduced(0.0, y)[0] - M)) > 1e-3 * np.max(np.abs(M))


def test_stage_two_is_the_third_with_a_rigid_node():
    """The same tree with its hinges at nodes that do not deform is another model, not the same with zeros."""
    moved = replace(CLAMPED, bodies=4)
    scene = clamped(random_scene(3, moved))
    M, _ = nested_system(scene).reduced(0.0, _start(scene))
    N, _ = nested_system(undeforming(scene)).reduced(0.0, _start(scene))
    assert M.shape == N.shape
    assert np.max(np.abs(M - N)) > 1e-3 * np.max(np.abs(M))


def _start(scene: s.Scene) -> np.ndarray:
    return packed(flexmb.compile(scene).initial_state)


FAST_TURNS = pytest.mark.filterwarnings("ignore:.*leaves out that this pulls it straight")  # fast turns are meant

CASES = {
    "three-wheel gyrostat with a flexible appendage": "wheel_gyrostat/flexible_appendage",
    "deploying boom": "deploying_boom/flexible",
}
RTOL = 1e-9


def scene(case: str):
    return at_level(flexmb.load_scene(ROOT / "cases" / CASES[case] / "scene.toml"), "linear")


@pytest.mark.parametrize("case", CASES)
@FAST_TURNS
def test_routes_run_alike(case):
    """Two seconds of adaptive steps; differences are rounding carried along, far below the tolerance."""
    system = flexmb.compile(scene(case))
    ours, theirs = (
        flexmb.simulate(system, 2.0, rtol=RTOL, atol=1e-2 * RTOL, samples=41, algorithm=algorithm)
        for algorithm in ("frisch", "articulated")
    )
    assert ours.finished and theirs.finished
    for found, expected in ((ours.q, theirs.q), (ours.u, theirs.u), (ours.work, theirs.work)):
        assert np.max(np.abs(found - expected)) <= RTOL * max(1.0, np.max(np.abs(expected)))
    largest = max(np.max(np.abs(load)) for load in theirs.loads.values())
    for found, expected in ((ours.loads, theirs.loads), (ours.wheel_loads, theirs.wheel_loads)):
        for name in expected:
            assert np.max(np.abs(found[name] - expected[name])) <= RTOL * largest
    for name in theirs.drives:
        assert np.max(np.abs(ours.drives[name] - theirs.drives[name])) <= RTOL * largest
    for name, path in theirs.markers.items():
        accelerations = np.max(np.abs(path.acceleration))
        assert np.max(np.abs(ours.markers[name].acceleration - path.acceleration)) <= RTOL * accelerations
    assert np.array_equal(ours.momentum, theirs.momentum) or np.allclose(ours.momentum, theirs.momentum, atol=RTOL)


@FAST_TURNS
def test_fixed_steps_too():
    """RK4 with the same steps differs by rounding alone."""
    system = flexmb.compile(scene("three-wheel gyrostat with a flexible appendage"))
    ours, theirs = (
        flexmb.simulate(system, 0.05, "rk4", step=1e-4, samples=3, algorithm=algorithm)
        for algorithm in ("frisch", "articulated")
    )
    assert np.max(np.abs(ours.u - theirs.u)) <= 1e-12 * np.max(np.abs(theirs.u))


@FAST_TURNS
def test_print_runs_away_with_a_flexible_body_inside():
    """The boom has flexible members inside the tree: as printed the run fails, and says when; nothing is lost."""
    system = flexmb.compile(scene("deploying boom"))
    printed = flexmb.simulate(system, 2.0, rtol=1e-6, atol=1e-8, samples=201, algorithm="frisch_as_printed")
    assert not printed.finished
    assert 0.0 < printed.stopped_at < 2.0
    assert len(printed.t) >= 1
    assert "stopped at" in printed.message


@FAST_TURNS
def test_a_check_of_one_state_is_not_for_runs():
    """The unsplit recursion is there to be compared with at a state; a run names what it can be done by."""
    system = flexmb.compile(scene("three-wheel gyrostat with a flexible appendage"))
    with pytest.raises(ValueError, match="frisch"):
        flexmb.simulate(system, 1.0, algorithm="unsplit")


@FAST_TURNS
def test_print_refuses_modes_that_are_not_clamped():
    system = flexmb.compile(random_scene(0))
    with pytest.raises(ValueError, match="clamps every body"):
        system.accelerations(system.initial_state, "frisch_as_printed")
