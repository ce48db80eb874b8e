"""Loads that infinitely many sets go with: NaN and named wherever loads are given, in whatever axes."""

from __future__ import annotations

import csv
from io import StringIO

import msgspec
import numpy as np
import pytest
from rich.console import Console

import flexmb
from flexmb.run.summary import summary
from flexmb.scene import schema as s
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
