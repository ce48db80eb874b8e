"""Causes that are named for wrong files: each for its fault alone, all that explain equally, none for other faults."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from crosscheck.cli.common import app
from crosscheck.library.find import load_case, shipped_folder
from crosscheck.library.reference import current_reference, values_text
from crosscheck.verify.against_case import CsvOutcome, verify_csv
from crosscheck.verify.clock import find_shift
from crosscheck.verify.columns import VerifyError
from crosscheck.verify.evidence import Evidence, turned
from crosscheck.verify.outcome import outcome_json
from crosscheck.verify.points import about_mass_centre, about_other_points
from flexmb.scene.bodies import BeamBody, BeamStation, Modes, SidBody
from flexmb.scene.rigid_equivalent import total_mass
from flexmb.scene.schema import Scene
from flexmb.typing import Real
from tests.crosscheck.sessions import here
from tests.crosscheck.verify.strangers import Stranger, written

Channels = dict[str, Real]
ORIGIN = "about World's origin"


def stored(name: str) -> tuple[Real, Channels]:
    reference = current_reference(load_case(shipped_folder() / name))
    return reference.times, {channel: rows.copy() for channel, rows in reference.channels.items()}


def verdicts(name: str, file: Path) -> CsvOutcome:
    return verify_csv(load_case(shipped_folder() / name), file, scheduler=here)


def causes(name: str, folder: Path, change: Callable[[Real, Channels], object]) -> dict[str, tuple[str, ...]]:
    """The causes found after a change of the stored reference, by channel that differs."""
    times, channels = stored(name)
    change(times, channels)
    outcome = verdicts(name, written(folder / "mine.csv", times, channels))
    return {
        verdict.channel: outcome.details[verdict.channel].causes
        for verdict in outcome.all
        if verdict.status == "differ"
    }


def adding(**amounts: float) -> Callable[[Real, Channels], object]:
    def change(_: Real, channels: Channels) -> None:
        for kind, amount in amounts.items():
            channels[f"energy.{kind}"] += amount

    return change


def scaling(name: str, factor: float) -> Callable[[Real, Channels], object]:
    def change(_: Real, channels: Channels) -> None:
        channels[name] *= factor

    return change


def about(path: Callable[[Channels], Real], part: float = 1.0) -> Callable[[Real, Channels], object]:
    """The angular momentum about a point, on its path (T,3) by the markers; `part` is 1 if it is right."""

    def change(_: Real, channels: Channels) -> None:
        channels["momentum.angular"] -= part * np.cross(path(channels), channels["momentum.linear"])

    return change


def noise(times: Real, channels: Channels) -> None:
    channels["load:elbow.torque"] += np.random.default_rng(1).normal(size=(len(times), 3))


def of_two_rods(channels: Channels) -> Real:
    """Mass centre of two equal rods of the double pendulum, from the origin to the elbow and on to the tip."""
    return 0.5 * channels["marker:elbow.position"] + 0.25 * channels["marker:tip.position"]


def of_the_gyrostat(_: Channels) -> Real:
    """Some point on the path of its mass centre, along the momentum: the hub and three wheels at the start."""
    places = np.array([[0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.2, -0.15, 0.25]])
    return (120.0 * np.array([0.04, -0.03, 0.05]) + 4.0 * places.sum(axis=0)) / 132.0


TURNING, MOVING, MOMENTUM = "marker:corner.angular_velocity", "marker:corner.velocity", "momentum.angular"
ELSEWHERE = "the energy is off by a constant, 7 J: its zero is elsewhere?"
TURNS = "the values are {}: revolutions per {} instead of rad/s"
# Changes of the stored reference of a case, and the cause that is named for each channel that differs, if any.
FAULTS = {
    "another zero": (
        "pendulums/compound", adding(gravity=7.0, total=7.0),
        {"energy.gravity": ELSEWHERE, "energy.total": "the energy is off by the same 7 J as energy.gravity is"},
    ),
    "another zero of what has none": ("pendulums/compound", adding(total=7.0), {"energy.total": ""}),
    "different zeros": (
        "pendulums/compound", adding(gravity=7.0, total=7.1), {"energy.gravity": ELSEWHERE, "energy.total": ""},
    ),
    "more than a constant": ("pendulums/compound", scaling("energy.gravity", 1.01), {"energy.gravity": ""}),
    "rpm": (
        "tops/free_body", scaling(TURNING, 30.0 / np.pi), {TURNING: TURNS.format("30/pi times too large", "minute")}
    ),
    "rps": ("tops/free_body", scaling(TURNING, 0.5 / np.pi), {TURNING: TURNS.format("2 pi times too small", "second")}),
    "nearly rpm": ("tops/free_body", scaling(TURNING, 9.5), {TURNING: ""}),
    "rpm of what does not turn": ("tops/free_body", scaling(MOVING, 30.0 / np.pi), {MOVING: ""}),
    "the mass centre": (
        "pendulums/double", about(of_two_rods),
        {MOMENTUM: f"it is the angular momentum about the mass centre, not {ORIGIN}"},
    ),
    "a fixed point": (
        "pendulums/double", about(lambda _: np.array([0.5, -0.25, 2.0])),
        {MOMENTUM: "it is the angular momentum about another point than World's origin, such as (0.5, -0.25, 2) m"},
    ),
    "a marker": (
        "pendulums/double", about(lambda channels: channels["marker:elbow.position"]),
        {MOMENTUM: f'it is the angular momentum about the marker "elbow", not {ORIGIN}'},
    ),
    "nearly the mass centre": ("pendulums/double", about(of_two_rods, part=1.01), {MOMENTUM: ""}),
    "another momentum": ("pendulums/double", scaling(MOMENTUM, 1.01), {MOMENTUM: ""}),
    "noise": ("pendulums/double", noise, {"load:elbow.torque": ""}),
}  # fmt: skip


@pytest.mark.parametrize(("case", "change", "named"), FAULTS.values(), ids=FAULTS)
def test_a_cause_is_named_for_its_fault_alone(
    case: str, change: Callable[[Real, Channels], object], named: dict[str, str], tmp_path: Path
) -> None:
    assert causes(case, tmp_path, change) == {channel: (said,) if said else () for channel, said in named.items()}


def test_two_causes_that_explain_equally_are_both_named(tmp_path: Path) -> None:
    """A free body's momentum is constant: about its mass centre, or about a point that it passes through."""
    point, centre = causes("wheel_gyrostat/torque_free", tmp_path, about(of_the_gyrostat))[MOMENTUM]
    assert "about another point than World's origin" in point
    assert "about the mass centre" in centre


def test_a_torque_about_the_mass_centre_is_named(tmp_path: Path) -> None:
    """Of a rod whose hinge has no torque, so that the reference is zero."""
    arm = np.array([0.5, 0.1, -0.2])

    def change(_: Real, channels: Channels) -> None:
        lever = turned(channels["marker:tip.orientation"], np.tile(arm, (len(channels["work"]), 1)))
        channels["load:elbow.torque"] -= np.cross(lever, channels["load:elbow.force"])

    (cause,) = causes("pendulums/double", tmp_path, change)["load:elbow.torque"]
    assert cause == (
        "it is the torque about a point of the body, its mass centre perhaps, (0.5, 0.1, -0.2) m from the hinge point "
        'in the axes of "tip"'
    )


def test_a_torque_about_a_fixed_point_and_about_the_origin_are_named(tmp_path: Path) -> None:
    def fixed(_: Real, channels: Channels) -> None:
        channels["load:elbow.torque"] -= np.cross([0.0, 0.3, 0.0], channels["load:elbow.force"])

    (cause,) = causes("pendulums/double", tmp_path, fixed)["load:elbow.torque"]
    assert cause == "it is the torque about a point that is (0, 0.3, 0) m from the hinge point in World axes"

    def origin(_: Real, channels: Channels) -> None:
        channels["load:elbow.torque"] += np.cross(channels["marker:elbow.position"], channels["load:elbow.force"])

    found = causes("pendulums/double", tmp_path, origin)["load:elbow.torque"]
    assert 'it is the torque about World\'s origin, not about the hinge point at "elbow"' in found


def test_a_constant_planar_moment_says_too_little() -> None:
    """Any constant error along z is a moment of a constant force in the plane about some point."""
    times, plane = np.linspace(0.0, 1.0, 20), np.tile([1.0, 0.0, 0.0], (20, 1))
    moment = np.tile([0.0, 0.0, 3.0], (20, 1))
    channels = {"momentum.angular": moment, "momentum.linear": plane}
    seen = Evidence("momentum.angular", 1.01 * moment, times, channels, 1e-9)
    assert list(about_other_points(seen)) == []
    assert about_mass_centre(seen, 1.0, lambda times: pytest.fail("nothing has to be known in between")) == ""


# Times


def test_times_in_another_unit_are_named(tmp_path: Path) -> None:
    times, channels = stored("wheel_gyrostat/torque_free")
    for unit, seconds in (("milliseconds", 1e-3), ("minutes", 60.0)):
        file = written(tmp_path / f"{unit}.csv", times / seconds, channels)
        with pytest.raises(VerifyError, match=f"the times are in {unit}: in seconds 1[0-9] of 1[0-9] channels that"):
            verdicts("wheel_gyrostat/torque_free", file)


def test_fine_samples_in_milliseconds_are_named_too(tmp_path: Path) -> None:
    """Enough of them are within the case's 10 s to be compared."""
    fine, name = np.linspace(0.0, 10.0, 10001), "marker:sensor.velocity"
    right = Stranger("wheel_gyrostat/torque_free").solution(fine)[name]
    with pytest.raises(VerifyError, match="the times are in milliseconds: in seconds 1 of 1 channels"):
        verdicts("wheel_gyrostat/torque_free", written(tmp_path / "mine.csv", 1e3 * fine, {name: right}))
    wrong = written(tmp_path / "wrong.csv", 1e3 * fine, {name: 1.01 * right})
    assert verdicts("wheel_gyrostat/torque_free", wrong).counts()["differ"] == 1


def test_wrong_values_are_not_put_down_to_the_unit_of_times(tmp_path: Path) -> None:
    times, channels = stored("wheel_gyrostat/torque_free")
    wrong = {"marker:sensor.velocity": 1.01 * channels["marker:sensor.velocity"]}
    with pytest.raises(VerifyError, match="do not cover") as refused:
        verdicts("wheel_gyrostat/torque_free", written(tmp_path / "mine.csv", times / 60.0, wrong))
    assert "minutes" not in str(refused.value)


@pytest.mark.parametrize("late", [0.3, -0.04, 0.9])
def test_a_shift_by_part_of_a_sample_is_found_exactly(late: float) -> None:
    """Of a path that is known at any time."""
    times = np.linspace(0.0, 10.0, 101)

    def path(when: Real) -> Channels:
        return {"marker:m.velocity": np.column_stack([np.sin(3.0 * when), np.cos(when**2 / 5.0), when])}

    def shifted(values: Real) -> Evidence:
        return Evidence("marker:m.velocity", values, times, path(times), 1e-9)

    seen = shifted(path(times - 0.1 * late)["marker:m.velocity"])
    found = find_shift({"marker:m.velocity": seen}, path, 10.0)
    assert found is not None
    assert found.late_s == pytest.approx(0.1 * late, rel=1e-7)
    assert f"s too {'late' if late > 0.0 else 'early'}, {abs(late):g} of a sample: times shifted?" in found.cause
    wrong = shifted(path(times - 0.1 * late)["marker:m.velocity"] * 1.0001)
    assert find_shift({"marker:m.velocity": wrong}, path, 10.0) is None


def test_a_shift_that_most_channels_do_not_share_is_none() -> None:
    """One of three channels is late: a clock would concern all of them."""
    times = np.linspace(0.0, 10.0, 101)

    def path(when: Real) -> Channels:
        return {f"marker:{name}.velocity": np.sin(when)[:, None] * np.eye(3)[i] for i, name in enumerate("abc")}

    def seen(name: str, values: Channels) -> Evidence:
        return Evidence(name, values[name], times, path(times), 1e-9)

    late, right = path(times - 0.03), path(times)
    heavy = {name: 1.001 * rows for name, rows in right.items()}
    differing = {name: seen(name, late if name == "marker:a.velocity" else heavy) for name in right}
    assert find_shift(differing, path, 10.0) is None
    shared = {name: seen(name, late) for name in right}
    found = find_shift(shared, path, 10.0)
    assert found is not None
    assert found.channels == tuple(right)


@pytest.mark.parametrize("size", [1e-13, 1e-6, 1.0])
def test_values_that_are_best_without_a_shift_have_none(size: float) -> None:
    """The search ends where it finds that the best shift is none, also when that is so at once."""
    times = np.linspace(0.0, 2.0 * np.pi, 41)

    def path(when: Real) -> Channels:
        return {"marker:m.velocity": np.column_stack([np.sin(when), np.cos(when), 0.0 * when])}

    def found(values: Real) -> object:
        seen = Evidence("marker:m.velocity", values, times, path(times), 1e-14)
        return find_shift({"marker:m.velocity": seen}, path, float(times[-1]))

    assert found(path(times)["marker:m.velocity"] + size * np.array([0.0, 0.0, 1.0])) is None
    assert found(path(times - 0.01)["marker:m.velocity"] + size * np.array([0.0, 0.0, 1.0])) is None


# What is not in the file


def test_channels_that_a_file_lacks_are_listed(tmp_path: Path) -> None:
    times, channels = stored("tops/free_body")
    kept = {name: rows for name, rows in channels.items() if name.startswith("marker:")}
    file = written(tmp_path / "mine.csv", times, kept)
    outcome = verdicts("tops/free_body", file)
    assert {verdict.channel for verdict in outcome.all} == set(kept)
    assert "momentum.angular" in outcome.not_given
    assert not set(outcome.not_given) & set(kept)
    told = f"{len(kept)} agree, {len(outcome.not_given)} not given: {', '.join(outcome.not_given)}"
    assert outcome.inventory == told
    assert json.loads(outcome_json(outcome))["not_given"] == list(outcome.not_given)
    shown = CliRunner().invoke(app, ["verify", "tops/free_body", str(file)], env={"COLUMNS": "200"})
    assert shown.exit_code == 0
    assert told in shown.stdout.replace("\n", " ")
    whole = tmp_path / "whole.csv"
    whole.write_text(values_text(times, channels), encoding="utf-8")
    assert not verdicts("tops/free_body", whole).not_given


# The mass


@pytest.mark.parametrize(("name", "kg"), [
    ("wheel_gyrostat/torque_free", 120.0 + 3 * 4.0),  # a hub and wheels
    ("free_flying/flexible_beam", 4.0 * 0.8 + 6.0),  # a uniform beam and a lump
    ("pendulums/double", 1.0 + 1.0),
])  # fmt: skip
def test_the_mass_of_a_scene_is_that_of_all_its_parts(name: str, kg: float) -> None:
    case = load_case(shipped_folder() / name)
    assert total_mass(case.scene(case.run.variants[0])) == pytest.approx(kg, rel=1e-14)


def test_the_mass_of_a_tapered_beam_and_of_a_file() -> None:
    stations = [
        BeamStation(x_m=x, EA_N=1e6, EIy_Nm2=1e3, EIz_Nm2=1e3, GJ_Nm2=1e3, mass_per_length_kg_m=density)
        for x, density in ((0.0, 2.0), (1.0, 2.0), (3.0, 4.0))
    ]
    tapered = BeamBody(name="beam", length_m=3.0, elements=4, stations=tuple(stations), modes=Modes(count=2))
    assert total_mass(Scene(name="tapered", bodies=(tapered,), hinges=())) == pytest.approx(2.0 + 6.0, rel=1e-14)
    from_file = SidBody(name="panel", file="panel.sid")
    with pytest.raises(ValueError, match='mass of body "panel" is in its SID file'):
        total_mass(Scene(name="file", bodies=(tapered, from_file), hinges=()))
