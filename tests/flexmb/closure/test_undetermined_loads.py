"""Loads that infinitely many sets go with: NaN and named wherever loads are given, in whatever axes; sums of them that
the motion determines, and one named choice of those that it does not."""

from __future__ import annotations

import csv
from io import StringIO
from pathlib import Path

import msgspec
import numpy as np
import pytest
from rich.console import Console

import flexmb
from flexmb.export.refusals import NotExportable, refuse
from flexmb.run.channels import channels_of
from flexmb.run.summary import summary
from flexmb.scene import schema as s
from flexmb.scene.files import dumps, loads
from flexmb.surrogate.segments import finite_segments
from tests.bounds import relative
from tests.flexmb.closure import mechanisms as m
from tests.flexmb.closure.least import least_loads
from tests.flexmb.closure.test_redundant_and_null import pendulum

OUT_OF_PLANE = [True, True, False, False, False, True]
NAMES = {"drive", "pin", "pivot", "loop"}


@pytest.fixture(scope="module")
def run() -> flexmb.Trajectory:
    """A planar four-bar closed in space by a revolute closure."""
    return flexmb.simulate(m.four_bar(), 0.2, samples=5)


def test_a_trajectory_names_them(run):
    assert {name: each.tolist() for name, each in run.undetermined.items()} == dict.fromkeys(NAMES, OUT_OF_PLANE)
    for load in run.loads.values():
        assert np.array_equal(np.isnan(load), np.tile(OUT_OF_PLANE, (5, 1)))
    determined = flexmb.simulate(m.four_bar(modes=2), 0.01, samples=2)
    assert determined.undetermined == {} and np.all(np.isfinite(determined.loads["pin"]))


def test_files_and_summaries_do_not_say_zero(run, tmp_path):
    run.to_csv(tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert all(row["pin.torque.x [N m]"] == "nan" and row["pin.force.x [N]"] != "nan" for row in rows)
    printed = StringIO()
    Console(file=printed, width=1000).print(summary(run))
    assert "pin (torque x, y; force z)" in printed.getvalue()


@pytest.mark.parametrize("axes", ["inboard", "outboard"])
def test_in_other_axes_what_is_open_there_is_named(run, axes):
    """About nodes and in axes that turn in the plane: what is determined is the least loads', turned."""
    system = flexmb.compile(m.four_bar())
    state = run.state_at(3)
    state = system.state(state.q, state.u, state.t)
    found = system.hinge_loads(state, axes=axes, about=("crank", "tip"))
    in_run = run.loads_in(axes, about=("crank", "tip"))
    expected = flexmb.System.referred_loads(system, state, least_loads(system, state), axes, ("crank", "tip"))
    for name in NAMES:
        assert np.array_equal(np.isnan(found[name]), OUT_OF_PLANE)
        known = ~np.isnan(found[name])
        assert relative(found[name][known], expected[name][known]) < 1e-12
        np.testing.assert_allclose(in_run[name][3], found[name], rtol=1e-9, atol=1e-9)


def test_across_sections_too():
    """At the root of a beam the section transmits what the hinge does, as far as that is determined."""
    flat = m.four_bar(modes=1)
    rigid = tuple(msgspec.structs.replace(body, level="rigid") for body in flat.bodies)
    system = flexmb.compile(msgspec.structs.replace(flat, bodies=rigid))
    state = system.initial_state
    section = system.section_loads(state, "coupler", [0.0, 0.4]).load
    hinge = system.hinge_loads(state, axes="outboard", about=("coupler", "root"))["pin"]
    assert np.array_equal(np.isnan(section), [OUT_OF_PLANE] * 2)
    assert section[0][[2, 3, 4]] == pytest.approx(hinge[[2, 3, 4]], rel=1e-9, abs=1e-12)


def test_drives_inside_a_loop_that_holds_itself():
    """Nobody knows what the drive carries and what the weld beside it."""
    run = flexmb.simulate(pendulum("weld", driven=s.Constant(value=0.0)), 0.1, samples=3)
    assert run.undetermined["turn.drive"].tolist() == [True] and np.all(np.isnan(run.drives["turn"]))
    assert np.all(np.isfinite(run.work))


WEIGHT = 2.0 * 9.81


@pytest.fixture(scope="module")
def door() -> flexmb.System:
    """A door on two hinges in one line, the upper one a closure from the other side: it swings about that line."""
    tree = flexmb.SceneBuilder("door", gravity=(0.0, 0.0, -9.81))
    tree.rigid_body("door", mass=2.0, com=(0.5, 0.0, 0.0), inertia=(0.1, 0.2, 0.3), nodes={"top": (0.0, 0.0, 1.0)})
    tree.revolute("lower", "ground", "door", angle=0.4, rate=1.5)
    tree.closure("upper", "revolute", "door", "ground", node_a="top", position_b=(0.0, 0.0, 1.0))
    return flexmb.compile(tree.marker("edge", "door").scene(), kernels="general")


def test_a_sum_over_parallel_pins_is_determined(door: flexmb.System) -> None:
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


def test_least_norm_is_one_choice_with_the_same_sum(door: flexmb.System) -> None:
    state = door.initial_state
    split, known = door.hinge_loads(state, redundant="least_norm"), door.determined_loads(state)
    assert all(np.all(np.isfinite(load)) for load in split.values())
    for name, load in door.hinge_loads(state).items():
        assert np.array_equal(load[known[name]], split[name][known[name]])
    apart = door.hinge_loads(state, about=("door", "origin"), redundant="least_norm")
    total = door.total_load(state, ["lower", "upper"], "door")
    assert np.allclose(apart["lower"] - apart["upper"], total, rtol=1e-12, atol=1e-12)


def test_sums_and_splits_over_a_run(door: flexmb.System) -> None:
    """The sum has no NaN where each pin has one; the split fills these alone, and its parts add up to the sum."""
    run = flexmb.simulate(door, 0.4, samples=5)
    open_ones = {name: np.isnan(load) for name, load in run.loads.items()}
    assert open_ones["lower"].any() and open_ones["upper"].any()
    total = run.total_load(["lower", "upper"], "door", about=("door", "top"))
    assert total.shape == (5, 6) and np.all(np.isfinite(total))
    assert np.allclose(total[:, 5], WEIGHT, rtol=1e-12)  # the centre moves in a plane
    split = run.loads_in(redundant="least_norm")
    for name, load in run.loads.items():
        assert np.all(np.isfinite(split[name])) and np.allclose(split[name][~open_ones[name]], load[~open_ones[name]])
    there = run.loads_in(about=("door", "top"), redundant="least_norm")
    assert np.allclose(there["lower"] - there["upper"], total, rtol=1e-10, atol=1e-10)
    alone = run.total_load(["lower"], "door", about=("door", "top"))
    assert np.isnan(alone).any()  # what is open stays open
    with pytest.raises(ValueError, match="redundant"):
        run.loads_in(redundant="guess")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no hinge or closure"):
        run.total_load(["middle"], "door")


def test_sums_over_a_run_with_a_controller_are_those_of_its_outputs() -> None:
    """Of a tree, where the sum is one hinge's load as the run has it."""
    tree = flexmb.SceneBuilder("held", gravity=(0.0, 0.0, -9.81))
    tree.rigid_body("arm", mass=1.0, com=(0.3, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    tree.revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0), torque=flexmb.ControlSignal(source="servo"))
    tree.sense_coordinate("angle", "pivot").pid("servo", "angle", kp=20.0, period=0.05)
    run = flexmb.simulate(tree.scene(), 0.3, samples=7)
    assert np.allclose(run.total_load(["pivot"], "arm"), run.loads["pivot"], rtol=1e-9, atol=1e-9)
    assert np.ptp(run.signals["servo"]) > 1.0


def test_a_tree_sums_too() -> None:
    tree = flexmb.SceneBuilder("pair", gravity=(0.0, 0.0, -9.81))
    for name in ("one", "two"):
        tree.rigid_body(name, mass=1.0, com=(0.1, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    tree.weld("root", "ground", "one").revolute("knee", "one", "two", axis=(0.0, 0.0, 1.0), rate=2.0)
    system = flexmb.compile(tree.scene(), kernels="general")
    total = system.total_load(system.initial_state, ["root", "knee"], "one")
    assert np.allclose(total, [0.0, -0.981, 0.0, 0.0, 0.0, 9.81], rtol=1e-12, atol=1e-12)  # its own weight


@pytest.mark.parametrize(
    ("joints", "on", "why"),
    [
        (["lower", "lower"], "door", "each once"), ([], "door", "each once"), ("lower", "door", "each once"),
        (["middle"], "door", "there is no hinge or closure"), (["lower"], "wall", "its load on 'wall' is none"),
    ],
)  # fmt: skip
def test_what_is_no_sum_is_refused(door: flexmb.System, joints: list[str], on: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        door.total_load(door.initial_state, joints, on)
    with pytest.raises(ValueError, match="redundant"):
        door.hinge_loads(door.initial_state, redundant="guess")  # type: ignore[arg-type]


def doubled(door: flexmb.System, **changes: object) -> s.Scene:
    """The door with the sum of what its pins exert on it, of what they exert on the frame, and one of a single pin."""
    totals = (
        s.TotalLoad(name="pins", joints=("lower", "upper"), body="door", node="top"),
        s.TotalLoad(name="frame", joints=("upper", "lower"), body="ground"),
        s.TotalLoad(name="one", joints=("lower",), body="door"),
    )
    return msgspec.structs.replace(door.scene, total_loads=totals, **changes)


def test_a_scene_names_sums_that_runs_have(door: flexmb.System, tmp_path: Path) -> None:
    """As fields, columns, channels and peaks; open are those alone whose sum is, and they are told."""
    scene = doubled(door)
    assert loads(dumps(scene)) == scene
    run = flexmb.simulate(scene, 0.4, samples=5)
    for total in scene.total_loads:
        expected = run.total_load(total.joints, total.body, about=(total.body, total.node))
        assert np.array_equal(run.total_loads[total.name], expected, equal_nan=True)
    assert np.isfinite(run.total_loads["pins"]).all() and np.isfinite(run.total_loads["frame"]).all()
    assert np.allclose(run.total_loads["pins"][:, 3:], -run.total_loads["frame"][:, 3:], rtol=0.0, atol=1e-12)
    assert {"one", "lower", "upper"} == set(run.undetermined)
    found = channels_of(run)
    assert np.array_equal(found["total_load:pins.force"], run.total_loads["pins"][:, 3:])
    run.to_csv(tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(encoding="utf-8") as file:
        last = list(csv.DictReader(file))[-1]
    assert float(last["pins.force.z [N]"]) == run.total_loads["pins"][-1, 5]
    peak = run.envelope.total_loads["pins"]
    assert np.all(peak.least <= run.total_loads["pins"].min(axis=0))
    assert np.all(peak.greatest >= run.total_loads["pins"].max(axis=0))
    assert run.envelope.magnitudes["total_load:pins.force"].largest[0] > WEIGHT
    whole = flexmb.simulate(scene, 0.2, samples=3).then(flexmb.simulate(scene, 0.4, t_start=0.2, samples=3))
    assert whole.total_loads["pins"].shape == (5, 6)


def test_sums_that_a_scene_names_follow_its_events_and_controllers() -> None:
    """Of a tree: the sum of one hinge is its load, across an event and with a sampled controller."""
    tree = flexmb.SceneBuilder("held", gravity=(0.0, 0.0, -9.81))
    tree.rigid_body("arm", mass=1.0, com=(0.3, 0.0, 0.0), inertia=(0.1, 0.1, 0.1))
    tree.revolute("pivot", "ground", "arm", axis=(0.0, 1.0, 0.0), torque=flexmb.ControlSignal(source="servo"))
    tree.sense_coordinate("angle", "pivot").pid("servo", "angle", kp=20.0, period=0.05)
    tree.event("stop", "time", 0.12, flexmb.Latch(coordinate="pivot.rotation")).total_load("sum", ["pivot"], "arm")
    run = flexmb.simulate(tree.scene(), 0.3, samples=7)
    assert len(run.events) == 1 and np.ptp(run.signals["servo"]) > 0.1
    assert np.allclose(run.total_loads["sum"][:, 3:], run.loads["pivot"][:, 3:], rtol=1e-9, atol=1e-9)
    assert np.ptp(run.loads["pivot"][:, 5]) > 0.1


def test_what_cannot_have_sums_of_a_scene_says_so(door: flexmb.System) -> None:
    scene = doubled(door)
    with pytest.raises(NotImplementedError, match="derivatives of total loads"):
        flexmb.sensitivities(scene, 0.1, ["door.mass_kg"], ["pins.force.z"])
    tree = flexmb.SceneBuilder("arm").beam("arm", length=1.0, elements=4, modes=1, section=m.STEEL)
    tree = tree.revolute("pivot", "ground", "arm").total_load("sum", ["pivot"], "arm").scene()
    with pytest.raises(NotExportable, match='total load "sum"'):
        refuse(tree)
    with pytest.raises(ValueError, match='leave out the total load "sum"'):
        finite_segments(tree, "arm", 3)
