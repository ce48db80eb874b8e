"""Runs through singular positions, where branches of the motion cross, and runs that pass near one."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

import flexmb
from flexmb.closure import branch
from flexmb.closure.tables import GROUP
from flexmb.run import segments
from flexmb.scene import build
from flexmb.scene import schema as s
from flexmb.tables.status import Status
from tests.bounds import gamma
from tests.flexmb.closure import mechanisms as m

LOST = (Status.BRANCH_UNKNOWN, Status.CLOSURE_SINGULAR)
SETTINGS = {
    "dop853": {}, "loose": {"rtol": 1e-6, "atol": 1e-8}, "looser": {"rtol": 1e-3, "atol": 1e-4},
    "stabilised": {"stabilise": 20.0}, "composite": {"algorithm": "composite"}, "rk4": {"method": "rk4", "step": 1e-3},
    "coarse rk4": {"method": "rk4", "step": 1e-2}, "radau5": {"method": "radau5", "rtol": 1e-6, "atol": 1e-8},
    "exponential": {"method": "exponential", "rtol": 1e-7, "atol": 1e-9},
}  # fmt: skip


@pytest.mark.parametrize(
    ("speed", "count", "settings"),
    [  # by default all numbers by one way to integrate, and all ways of one number
        pytest.param(*each, marks=[] if each[2] == "dop853" or each[:2] == (30.0, 2) else pytest.mark.slow)
        for each in product((30.0, 1.0), (1, 2, 5, 10), SETTINGS)
    ],
)
def test_windows_stay_parallel_where_all_bars_lie_on_one_line(count, speed, settings):
    """One four-bar, many, even numbers of rows turned over at once: none turns into the branch that folds."""
    loose = {"loose": 1e-5, "looser": 1e-3, "coarse rk4": 1e-5, "radau5": 1e-3, "exponential": 1e-5}
    tolerance = loose.get(settings, 1e-8)
    _stays_parallel(count, speed, 2.0, SETTINGS[settings], tolerance)


@pytest.mark.parametrize("settings", ["dop853", "rk4"])
@pytest.mark.parametrize("count", [1, 2, 5, *(pytest.param(n, marks=pytest.mark.slow) for n in (10, 40))])
def test_the_benchmark_of_the_windows(count, settings):
    """Ten seconds by default settings, to 1e-6 rad, as the energy integral says."""
    _stays_parallel(count, 1.0, 10.0, SETTINGS[settings], 1e-6)


def _stays_parallel(count: int, speed: float, t_end: float, settings: dict, tolerance: float) -> None:
    system = flexmb.compile(m.windows(count, speed))
    run = flexmb.simulate(system, t_end, **settings)
    assert run.finished, run.message
    expected = m.windows_turn(count, speed, run.t)
    for i in range(count + 1):
        assert np.max(np.abs(run.q[:, system.coordinate(f"foot {i}").start] - expected)) < tolerance


@pytest.mark.parametrize("settings", SETTINGS)
def test_a_driven_parallelogram_stays_one(settings):
    """The crank turns evenly, whatever the closure loads: only the rocker's speed says where to go."""
    bars = m.FourBar(0.4, 1.0, 0.4, 1.0)
    scene = m.four_bar(bars, crank=1.0, prescribed=s.Ramp(value=1.0, rate=2.0))
    run = flexmb.simulate(scene, 6.0, samples=61, **SETTINGS[settings])
    assert run.finished, run.message
    assert np.max(np.abs(np.sin(0.5 * (run.q[:, 0] - run.q[:, 2])))) < 1e-9


def test_what_is_nearly_a_parallelogram_folds():
    """With a ground ever less longer than the coupler its motion has a limit, which is not that of a parallelogram."""
    found = []
    for longer in (1e-4, 1e-6, 1e-8):
        bars = m.FourBar(0.4, 1.0, 0.4, 1.0 + longer)
        run = flexmb.simulate(m.four_bar(bars, crank=1.0, rate=8.5676, gravity=0.0), 2.0, samples=5)
        assert run.finished and np.max(np.abs(run.energy_drift)) < 1e-7
        found.append(run.q[-1, [0, 2]])
    assert found[-1][1] - found[-1][0] > 1.0  # of a parallelogram both are the same
    assert np.linalg.norm(found[2] - found[1]) < 0.2 * np.linalg.norm(found[1] - found[0])


@pytest.mark.parametrize("settings", SETTINGS)
def test_a_step_over_many_turns_is_not_taken(settings):
    """Without gravity the windows turn evenly: any step is accurate, and would jump over several flat positions."""
    run = flexmb.simulate(m.windows(1, 30.0, gravity=0.0), 3.0, samples=7, **SETTINGS[settings])
    assert run.finished and run.statistics.accepted_steps > 2 * 28  # flat positions, each with its leap
    tolerance = {"radau5": 1e-6, "exponential": 1e-8}.get(settings, 1e-9)
    assert np.max(np.abs(run.q[:, 0] - 0.5 * np.pi + 30.0 * run.t)) < tolerance


@pytest.mark.parametrize("settings", ["dop853", "rk4"])
def test_samples_and_ends_may_lie_at_singular_positions(settings):
    """Every half second all bars lie on one line, whatever steps end there.

    Beside such a position, at a distance d, the rows of the closure are independent by d, so that the roundings on the
    way round the loop, some thirty, are divided by d in the loads: of what is sampled there they make a per cent.
    """
    for t_end in (4.0, 4.5 - 1e-4, 4.5 + 1e-4):
        run = flexmb.simulate(m.windows(1, np.pi, gravity=0.0), t_end, **SETTINGS[settings])
        assert run.finished, run.message
        assert np.max(np.abs(run.q[:, 0] - 0.5 * np.pi + np.pi * run.t)) < 1e-7
    times = [0.0, 0.499, 0.5, 0.501, 1.0]
    run = flexmb.simulate(m.windows(1, np.pi, gravity=0.0), 1.0, samples=times, **SETTINGS[settings])
    before, there, after = run.loads["window 0"][1:4, 2:5]  # the rest is open, at all times
    distance = np.max(np.abs(run.q[2] - 0.5 * (run.q[1] + run.q[3])))  # the turn is even
    known = max(1e-3, gamma(32) / distance)
    assert run.finished and np.max(np.abs(there - 0.5 * (before + after))) < known * np.linalg.norm(there)
    assert np.array_equal(run.undetermined["window 0"], [True, True, False, False, False, True])


@pytest.mark.parametrize("t_end", [4.5, 4.5 - 1e-4, 4.5 + 1e-4])
def test_a_run_that_ends_within_a_leap_is_integrated_once(t_end, monkeypatch):
    """The leap goes on beyond the end of the run, whose last sample lies within it: such a run cannot be taken up."""
    calls, whole = [], segments.integrate

    def counted(*given, **settings):
        calls.append(given)
        return whole(*given, **settings)

    monkeypatch.setattr(segments, "integrate", counted)
    run = flexmb.simulate(m.windows(1, np.pi, gravity=0.0), t_end)
    assert run.finished and len(calls) == 1, run.message
    assert (run.restart is None) == (t_end >= 4.5)  # before it the position is not reached
    assert np.max(np.abs(run.q[:, 0] - 0.5 * np.pi + np.pi * run.t)) < 1e-7


@pytest.mark.parametrize("settings", ["dop853", "rk4"])
def test_a_start_where_branches_cross_is_no_motion(settings):
    """All bars on one line at the start: rank and branch are not known there."""
    scene = m.windows(1, 1.0)
    flat = [msgspec.structs.replace(hinge, rotation=build.angular(angle=0.0, rate=hinge.rotation.rate_rad_s))
            for hinge in scene.hinges]  # fmt: skip
    run = flexmb.simulate(msgspec.structs.replace(scene, hinges=tuple(flat)), 1.0, **SETTINGS[settings])
    assert not run.finished and run.stopped_at < 1e-2


def test_a_mechanism_that_comes_to_rest_at_a_singular_position_is_not_said_to_go_on():
    """Thrown up to where it lies flat, it has no speed that says along which branch it falls back."""
    turn = np.sqrt(2.0 * 9.81 * 2.0 * 3.0 / 5.0)  # from 1/2 (5/3) turn'^2 = 2 g sin(turn), upright at the start
    run = flexmb.simulate(m.windows(1, turn, gravity=9.81), 2.0, max_steps=2000)
    assert not run.finished


@pytest.mark.parametrize(
    ("longer", "settings"),
    [  # by default all distances by two ways to integrate, and all ways at one distance
        pytest.param(*each, marks=[] if each[1] in ("dop853", "rk4") or each[0] == 1e-3 else pytest.mark.slow)
        for each in product((1e-2, 1e-3, 1e-5, 1e-8, 0.0), SETTINGS)
    ],
)
def test_passing_near_a_singular_position_is_right_or_stops(longer, settings):
    """A rod hardly longer than the crank: the slider turns back close to the crankshaft, on one side of it.

    With a rod as long as the crank it goes on through the crankshaft, to the other side.
    """
    crank, rod = 0.2, 0.2 * (1.0 + longer)
    system = flexmb.compile(m.slider_crank(crank, rod, angle=0.4, rate=12.0))
    run = flexmb.simulate(system, 5.0, **SETTINGS[settings])
    turn = run.q[:, system.coordinate("drive").start]
    lean = np.sqrt(rod**2 - (crank * np.sin(turn)) ** 2) if longer else crank * np.cos(turn)
    assert np.max(np.abs(run.markers["piston"].position[:, 0] - crank * np.cos(turn) - lean)) < 1e-9
    fixed = "rk4" in settings
    assert run.finished or (fixed and 0.0 < longer < 1e-2), run.message
    if settings == "dop853":
        assert np.max(np.abs(run.energy_drift)) < 1e-8


@pytest.mark.parametrize("settings", SETTINGS)
@pytest.mark.parametrize(
    "scene", [m.four_bar(), m.four_bar(closure="spherical"), m.slider_crank(0.2, 0.7, angle=0.4), m.bennett()],
    ids=["four-bar", "spherical", "slider-crank", "Bennett"],
)  # fmt: skip
def test_regular_motion_goes_on(scene, settings):
    """Ten seconds, with steps as long as tolerances allow."""
    assert flexmb.simulate(scene, 10.0, **SETTINGS[settings]).finished


def test_samples_between_steps_do_not_disturb():
    """Output inside steps is projected too, at times before the state that the next step starts from."""
    runs = [flexmb.simulate(m.four_bar(), 5.0, samples=count) for count in (2, 5001)]
    assert all(run.finished for run in runs)
    assert runs[0].statistics.accepted_steps == runs[1].statistics.accepted_steps
    assert np.max(np.abs(runs[0].q[-1] - runs[1].q[-1])) < 1e-12


def test_as_many_modes_across_the_plane_as_rows_make_a_loop_singular():
    """Three bars with one mode each across the plane, three rows across it: at some angles they are dependent.

    Nothing moves across the plane, so the run goes on as with a ball joint, which has no such angles.
    """
    run, ball = (flexmb.simulate(m.four_bar(modes=2, closure=kind), 0.5) for kind in ("revolute", "spherical"))
    assert run.finished and ball.finished
    assert np.max(np.abs(run.markers["joint"].position - ball.markers["joint"].position)) < 1e-7


@pytest.mark.parametrize("turned", [0.0, 0.4, 0.6, 1.0])
@pytest.mark.parametrize("row", [0, 1])
def test_what_has_turned_over(row, turned, monkeypatch):
    """The judge by itself: 60 degrees are the limit, and what is not a number is not the same branch."""
    monkeypatch.setattr(branch, "along", branch.along.py_func)

    def found(basis: np.ndarray) -> int:
        groups = np.zeros(2, GROUP).view(np.recarray)
        groups.row_start, groups.own_stop, groups.column_stop, groups.half = (0, 2), 3, 3, (0, 6)
        ahead, former = np.eye(2, 3), np.eye(2, 3)  # the group before it has not turned
        cw = SimpleNamespace(
            basis=np.append(ahead, basis), former=np.append(ahead, former), rank=[2, 2], chosen=[1, 3, 4, 7]
        )
        return int(branch.turned_over.py_func(SimpleNamespace(group=groups), cw))

    basis, angle = np.eye(2, 3), np.radians(59.0 + 2.0 * turned)
    basis[row] = np.cos(angle) * basis[row] + np.sin(angle) * np.array([0.0, 0.0, 1.0])
    assert found(basis) == (-1 if angle < np.radians(60.0) else [4, 7][row])
    assert found(-np.eye(2, 3)) == 4
    basis[row] = np.nan
    assert found(basis) == [4, 7][row]
