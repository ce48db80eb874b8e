"""Peaks over all steps of a run and both sides of events, whatever its output times are."""

from __future__ import annotations

import copy
import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import flexmb as fm
from flexmb.ready import scenes
from flexmb.run import followed
from flexmb.run.peaks import INSIDE, at_points, between

METHODS = [
    ("dop853", {}), ("radau5", {"rtol": 1e-7, "atol": 1e-9}), ("exponential", {}), ("rk4", {"step": 1e-2}),
    ("generalised_alpha", {"step": 5e-3}),
]  # fmt: skip
SCENES = sorted((Path(__file__).parents[3] / "cases").glob("*/*/scene.toml"))
QUICK = "sliders/rotating_tube", "closed_chains/slider_crank", "deploying_boom/latching", "connectors/one_at_a_time"
SPEED, STIFF, MASS = 0.5, 4e4, 2.0


def pendulum(angle: float = 1.0) -> fm.Scene:
    return (
        fm.SceneBuilder("pendulum", gravity=(0.0, -9.81, 0.0))
        .rigid_body("bob", mass=2.0, com=(0.0, -1.5, 0.0), inertia=(0.1, 0.1, 0.1))
        .revolute("pivot", "ground", "bob", angle=angle)
        .marker("bob", "bob", offset=(0.0, -1.5, 0.0))
        .scene()
    )


def latching() -> fm.Scene:
    """A carriage latches with its speed, and the mass on a stiff spring on it rings: v sqrt(k m) on the rail."""
    return (
        fm.SceneBuilder("latching")
        .rigid_body("carriage", mass=3.0, inertia=(1.0, 1.0, 1.0)).rigid_body("mass", mass=MASS, inertia=(1.0,) * 3)
        .prismatic("rail", "ground", "carriage", axis=(1.0, 0.0, 0.0), rate=SPEED)
        .prismatic("spring", "carriage", "mass", axis=(1.0, 0.0, 0.0), stiffness=STIFF, damping=60.0)
        .event("latch", "rail.translation", 0.25, fm.Latch(coordinate="rail.translation"))
        .scene()
    )  # fmt: skip


def ringing() -> float:
    """The largest of |k x + c v| behind the latch, of the damped oscillation."""
    t, w, damping = np.linspace(0.0, 0.1, 1_000_001), np.sqrt(STIFF / MASS), 60.0
    decay = damping / (2.0 * MASS)
    wd = np.sqrt(w**2 - decay**2)
    x = SPEED / wd * np.exp(-decay * t) * np.sin(wd * t)
    v = SPEED * np.exp(-decay * t) * np.cos(wd * t) - decay * x
    return float(np.max(np.abs(STIFF * x + damping * v)))


@pytest.mark.parametrize(("method", "settings"), METHODS)
def test_a_pendulum_pulls_most_at_the_bottom(method: str, settings: dict) -> None:
    """m g + m l w^2, (I + m l^2) w^2 = 2 m g l (1 - cos a): two output times, both of them at its sides."""
    run = fm.simulate(pendulum(), 2.6, method, samples=2, **settings)
    fastest = np.sqrt(2.0 * 2.0 * 9.81 * 1.5 * (1.0 - np.cos(1.0)) / (0.1 + 2.0 * 1.5**2))
    pull = 2.0 * 9.81 + 2.0 * 1.5 * fastest**2
    found = run.envelope
    load, size = found.loads["pivot"], found.magnitudes["load:pivot.force"]
    assert abs(size.greatest[0] - pull) <= 1e-4 * pull and abs(load.greatest[4] - pull) <= 1e-4 * pull
    assert size.error[0] <= 0.02 * pull and abs(size.greatest[0] - pull) <= size.error[0] + 1e-5 * pull
    assert np.max(np.linalg.norm(run.loads["pivot"][:, 3:], axis=1)) < 0.8 * pull  # by output times alone
    assert abs(found.u.largest[0] - fastest) < 1e-4 * fastest
    assert abs(found.magnitudes["marker:bob.velocity"].greatest[0] - 1.5 * fastest) < 2e-4
    at_bottom = fm.simulate(pendulum(), load.t_greatest[4], method, samples=2, **settings)
    assert abs(at_bottom.q[-1, 0]) < 0.02
    assert found.t_start == 0.0 and found.t_end == 2.6 and found.left_out == 0
    assert found.steps == run.statistics.accepted_steps


def test_what_output_times_miss_behind_a_latch() -> None:
    peak = ringing()
    for samples in (2, 21, 101):
        run = fm.simulate(latching(), 5.0, samples=samples)
        assert np.abs(run.loads["rail"][:, 3]).max() < 0.75 * peak  # by output times alone
        load = run.envelope.loads["rail"]
        assert abs(load.largest[3] - peak) < min(5e-4 * peak, load.error[3]) and load.error[3] < 0.02 * peak
        (latch,) = run.events
        assert latch.t < (load.t_greatest[3] if load.greatest[3] == load.largest[3] else load.t_least[3]) < 0.6
        drive = run.envelope.drives["rail"]
        assert abs(drive.largest[0] - peak) < 5e-4 * peak


def test_output_times_do_not_matter() -> None:
    """To the bit, for a method that adapts its steps: those of the motion are the same."""
    first, *others = (fm.simulate(latching(), 5.0, samples=samples).envelope for samples in (2, 7, 1001))
    for other in others:
        for one, two in zip(first.channels, other.channels, strict=True):
            assert one[:2] == two[:2]
            near = one[2].error + two[2].error + 1e-12 * one[2].largest
            assert np.all(np.abs(one[2].greatest - two[2].greatest) <= near), one[0]
        assert np.array_equal(first.loads["rail"].greatest[3:4], other.loads["rail"].greatest[3:4])


@pytest.mark.parametrize("samples", [3, 400])
def test_it_contains_every_output_and_every_state_at_events(samples: int) -> None:
    for run in (
        fm.simulate(scenes.with_events(scenes.pendulum(), "pivot.rotation"), 2e-3, samples=samples),
        fm.simulate(scenes.with_feedback(scenes.pendulum(), period=4e-2, delay=1e-2), 1.0, samples=samples),
        fm.simulate(scenes.with_feedback(scenes.pendulum()), 1.0, samples=samples),
        fm.simulate(scenes.looped().scene(), 0.5, samples=samples),
    ):
        columns = {name: values for name, _, values in run.columns()}
        for name, _, found in run.envelope.channels:
            if name in columns and np.isfinite(columns[name]).any():
                assert found.least[0] <= np.nanmin(columns[name]) <= np.nanmax(columns[name]) <= found.greatest[0], name
        u, names = run.envelope.u, [name for name, _ in run.u_names]
        for event in run.events:
            for state in (event.before, event.after):
                assert np.all(u.least - 1e-9 <= state.u) and np.all(state.u <= u.greatest + 1e-9), names


def test_a_jump_has_two_sides() -> None:
    """A force between two output times, on a body that rests: its load is there from its start to its end only."""
    pulse = fm.Pulse(value=70.0, start_s=0.21, duration_s=0.02)
    scene = (
        fm.SceneBuilder("pushed").rigid_body("block", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .rigid_body("wheel", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .weld("foot", "ground", "block").revolute("axle", "block", "wheel", rate=1.0)
        .force("push", "block", direction=(1.0, 0.0, 0.0), function=pulse)
        .scene()
    )  # fmt: skip
    run = fm.simulate(scene, 1.0, samples=11)
    assert not np.any(run.loads["foot"])
    load = run.envelope.loads["foot"]
    assert abs(load.least[3] + 70.0) < 1e-12 and 0.21 <= load.t_least[3] < 0.23 and abs(load.greatest[3]) < 1e-12


@pytest.mark.parametrize(("method", "settings"), METHODS[::3])
def test_a_resumed_run_and_joined_ones_have_that_of_the_whole(method: str, settings: dict) -> None:
    whole = fm.simulate(pendulum(), 2.0, method, samples=5, **settings)
    first = fm.simulate(pendulum(), 1.0, method, samples=3, **settings)
    later = fm.simulate(pendulum(), 2.0, method, samples=3, state=first.restart, **settings)
    for made in (first.then(later), whole):
        assert np.allclose(made.envelope.loads["pivot"].greatest, whole.envelope.loads["pivot"].greatest, atol=1e-5)
    assert later.envelope.t_start == 1.0
    stages = fm.simulate_stages(pendulum(), [fm.RunStage(1.0, samples=2), fm.RunStage(2.0, samples=2)])
    expected = fm.simulate(pendulum(), 2.0, samples=2).envelope.loads["pivot"].greatest
    assert np.allclose(stages.envelope.loads["pivot"].greatest, expected, atol=1e-5)


def test_groups_of_steps_give_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    run = fm.simulate(scenes.with_feedback(scenes.pendulum(), period=4e-2), 1.0, samples=3)
    whole = copy.deepcopy(run).envelope
    monkeypatch.setattr(followed, "MEMORY", 1)
    for one, two in zip(run.envelope.channels, whole.channels, strict=True):
        assert np.allclose(one[2].greatest, two[2].greatest, rtol=1e-8, atol=1e-8 + float(one[2].error[0])), one[0]
    assert run.envelope.steps == whole.steps


def test_a_run_that_stopped_has_one_up_to_there() -> None:
    run = fm.simulate(pendulum(), 2.0, samples=3, max_steps=20)
    assert not run.finished
    assert run.envelope.t_end == run.stopped_at and 0 < run.envelope.steps <= 20


def test_what_is_no_run_of_simulate_is_refused() -> None:
    run = fm.simulate(pendulum(), 0.1, samples=3)
    other = fm.simulate(latching(), 0.1, samples=3)
    for wrong in (replace(run, ways=()), replace(run, ways=other.ways), replace(run, t=run.t + 1.0)):
        with pytest.raises(ValueError, match="the envelope needs a trajectory as simulate made it"):
            wrong.envelope  # noqa: B018


def test_it_is_written_with_units(tmp_path: Path) -> None:
    run = fm.simulate(latching(), 1.0, samples=3)
    run.envelope.to_csv(tmp_path / "envelope.csv")
    header, *rows = csv.reader((tmp_path / "envelope.csv").read_text(encoding="utf-8").splitlines())
    assert header == ["channel", "unit", "least", "at [s]", "greatest", "at [s]", "error"]
    units = {name: unit for name, unit, _ in run.columns()}
    by_name = {row[0]: row for row in rows}
    missing = set(units) - set(by_name)
    assert all(name in ("t", "work") or ".quaternion." in name for name in missing)
    assert all(units.get(name, row[1]) == row[1] for name, row in by_name.items())
    assert float(by_name["rail.force.x"][4]) == run.envelope.loads["rail"].greatest[3]


def test_polynomials_between_points() -> None:
    """Of a sine with 0.6 rad a panel, exact to 1e-6 of it; stated to 1e-3; and what is not known stays so."""
    ends = np.arange(0.0, 40.0, 0.6)
    t = ends[:-1, None] + np.array([0.0, *INSIDE, 1.0]) * 0.6
    values = np.stack([np.sin(t + 0.3), np.exp(-t), np.full(t.shape, np.nan)], axis=2)
    found = between(t, values)
    assert abs(found.greatest[0] - 1.0) < 1e-6 and abs(found.least[0] + 1.0) < 1e-6 and 1e-6 < found.error[0] < 1e-3
    assert np.min(np.abs(np.sin(found.t_greatest[0] + 0.3) - 1.0)) < 1e-8
    assert abs(found.greatest[1] - 1.0) < 1e-14 and found.t_greatest[1] == 0.0
    assert np.isnan(found.greatest[2]) and np.isnan(at_points(t.ravel(), values.reshape(-1, 3)).least[2])


def _case(path: Path) -> str:
    return "/".join(path.parts[-3:-1])


@pytest.mark.parametrize(
    "path",
    [pytest.param(scene, id=_case(scene), marks=() if _case(scene) in QUICK else pytest.mark.slow) for scene in SCENES],
)
@pytest.mark.filterwarnings("ignore::flexmb.SceneWarning", "ignore::flexmb.PrecisionWarning")
def test_it_contains_what_finer_output_times_show(path: Path) -> None:
    """Of the scenes of all cases, from a run with three output times, up to the error that it states."""
    scene = fm.load_scene(path)
    coarse = fm.simulate(scene, 0.2, samples=3, max_steps=1500)
    fine = fm.simulate(scene, coarse.stopped_at, samples=101, max_steps=1500)
    found, columns = coarse.envelope, {name: values for name, _, values in fine.columns()}
    assert found.steps == coarse.statistics.accepted_steps and found.left_out == 0
    for name, _, extremes in found.channels:
        values = columns.get(name)
        if values is not None and np.isfinite(values).all():
            over = max(values.max() - extremes.greatest[0], extremes.least[0] - values.min())
            assert over <= extremes.error[0] + 1e-6 * extremes.largest[0] + 1e-9, name
