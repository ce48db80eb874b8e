"""Sums of loads of redundant joints: what each code shares in its own way, all of them sum alike."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from crosscheck.engines.checked import CheckedEngine
from crosscheck.engines.contract import Run, Trajectory
from crosscheck.engines.openness import Openness
from crosscheck.mutation.invariances.placed import MOVED
from crosscheck.running.undetermined import undetermined
from flexmb.run.channels import channels_of
from flexmb.scene.build import SceneBuilder
from flexmb.scene.schema import Scene, TotalLoad
from tests.crosscheck.engines.peers import installed

TIMES = np.linspace(0.0, 0.5, 6)
PINS, FRAME, ONE, EDGE = (
    TotalLoad(name="pins", joints=("lower", "upper"), body="door", node="top"),
    TotalLoad(name="frame", joints=("upper", "lower"), body="ground"),
    TotalLoad(name="one", joints=("lower",), body="door"),
    TotalLoad(name="edge", joints=("latch",), body="door", node="edge"),
)
SUMS = "pins", "frame", "edge"
WITHIN = {"pinocchio": 1e-9, "mujoco": 1e-9, "exudyn": 1e-5}
"""Relative to the largest of all sums: the last one has steps of second order."""


def door() -> Scene:
    """A door on two pins in one line, the lower one a hinge, with a latch on its edge; it swings as gravity pulls."""
    tree = SceneBuilder("door", gravity=(0.3, 0.0, -9.81))
    nodes = {"low": (0.0, 0.1, 0.2), "top": (0.0, 0.1, 1.2), "edge": (1.0, 0.0, 0.5)}
    tree.rigid_body("door", mass=2.0, com=(0.5, 0.1, 0.3), inertia=(0.1, 0.2, 0.3), nodes=nodes)
    tree.rigid_body("latch", mass=0.2, com=(0.0, 0.1, 0.0), inertia=(0.01, 0.01, 0.01))
    tree.revolute("lower", "ground", "door", child_node="low", parent_position=(0.2, 0.0, 0.0), rate=1.5)
    tree.revolute("latch", "door", "latch", parent_node="edge", axis=(1.0, 0.0, 0.0), rate=0.5)
    tree.closure("upper", "revolute", "ground", "door", position_a=(0.2, 0.0, 1.0), node_b="top")
    scene = tree.marker("edge", "door", node="edge").scene()
    return structs.replace(scene, total_loads=(PINS, FRAME, ONE, EDGE))


def run_of(name: str, scene: Scene) -> Trajectory:
    checked = CheckedEngine(installed(name), duration_s=float(TIMES[-1]))
    return checked.compile(scene).simulate(Run(TIMES), checked.efforts(scene)[-1])


def test_what_is_open_is_told_by_the_rank_of_the_closures() -> None:
    found = undetermined(door(), 0.5)
    assert {"total_load:one.force", "total_load:one.torque"} <= set(found.by_channel)
    assert not any(f"total_load:{name}.{part}" in found for name in SUMS for part in ("torque", "force"))
    assert Openness.of(run_of("native", door()).undetermined).names == found.names


@pytest.mark.parametrize("name", WITHIN)
def test_other_codes_sum_as_flexmb_does(name: str) -> None:
    """About the node that is asked for: about another one, torques are others."""
    ours, theirs = (channels_of(run_of(each, door())) for each in ("native", name))
    for part in ("torque", "force"):
        channels = [f"total_load:{each}.{part}" for each in SUMS]
        largest = max(np.abs(ours[channel]).max() for channel in channels)
        for channel in channels:
            assert np.abs(ours[channel]).max() > 0.01
            assert np.abs(theirs[channel] - ours[channel]).max() < WITHIN[name] * largest
    assert {channel for channel in theirs if channel.startswith("marker:")} <= set(ours)  # none that only sums need
    elsewhere = structs.replace(door(), total_loads=(structs.replace(PINS, node="edge"),))
    other = channels_of(run_of(name, elsewhere))["total_load:pins.torque"]
    assert np.abs(other - ours["total_load:pins.torque"]).max() > 1.0


@pytest.mark.parametrize("name", ["native", "pinocchio"])
def test_a_snapshot_has_them_too(name: str) -> None:
    checked = CheckedEngine(installed(name))
    seen, run = checked.compile(door()).evaluate(), run_of(name, door())
    assert all(np.allclose(seen.total_loads[each], run.total_loads[each][0], atol=1e-9) for each in SUMS)
    assert set(seen.markers) == {"edge"}


def test_a_sum_that_an_engine_has_no_loads_for_is_left_out() -> None:
    model = CheckedEngine(installed("pinocchio")).compile(door())
    assert model.watched is not None
    run = model.model.simulate(Run(TIMES), installed("pinocchio").efforts(door())[-1])
    fewer = {name: load for name, load in run.loads.items() if name != "upper"}
    assert set(model.watched.told(replace(run, loads=fewer)).total_loads) == {"one", "edge"}


def test_a_frame_that_stands_elsewhere_gets_other_torques() -> None:
    """Sums on the ground are about its origin: an invariance that moves the World says so."""
    scene = door()
    counterpart = MOVED.of(scene)
    ours, there = (channels_of(run_of("native", each)) for each in (scene, counterpart.scene))
    back = counterpart.back(TIMES, there)
    for name in SUMS:
        assert np.allclose(back[f"total_load:{name}.torque"], ours[f"total_load:{name}.torque"], atol=1e-6)
    assert not np.allclose(there["total_load:frame.torque"], ours["total_load:frame.torque"], atol=1e-2)
