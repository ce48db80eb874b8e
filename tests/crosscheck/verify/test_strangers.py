"""Strangers' files against stored references, for which no engine runs: what agrees, and what is caught where."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from crosscheck.cli.common import app
from crosscheck.library.find import Case, load_case, shipped_folder
from crosscheck.library.reference import load_reference, values_text
from crosscheck.verify.against_case import CsvOutcome, outcome_json, sample_times_csv, verify_csv
from crosscheck.verify.columns import VerifyError, short_names
from crosscheck.verify.resample import resample
from flexmb.run.channels import distance
from flexmb.typing import Real

FLIPPED = [
    ("wheel_gyrostat/torque_driven", "wheel_load:wheel_skew.torque"),
    ("wheel_gyrostat/torque_free", "momentum.angular"),
    ("wheel_gyrostat/dual_spinner", "marker:rim.orientation"),
    ("wheel_gyrostat/flexible_appendage", "marker:tip.velocity"),
    ("closed_chains/four_bar", "load:loop.force"),
    ("closed_chains/slider_crank", "marker:slider.position"),
    ("deploying_boom/rigid", "marker:tip.angular_velocity"),
    ("free_flying/flexible_beam", "marker:tip.position"),
    ("stiff/stiff_hinge_springs", "marker:tip.velocity"),
    ("large_deflection/princeton_beam", "marker:tip.position"),
]


def shipped(name: str) -> Case:
    return load_case(shipped_folder() / name)


@pytest.fixture(autouse=True)
def no_engine_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("an engine was asked to run")

    monkeypatch.setattr("crosscheck.verify.against_case.run_planned", refuse)


def write(file: Path, times: Real, channels: dict[str, Real]) -> Path:
    """A CSV with the short names of columns."""
    names = [name for channel, rows in channels.items() for name in short_names(channel, rows.shape[1])]
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        writer.writerow(["t", *names])
        writer.writerows(np.column_stack([times, *channels.values()]).tolist())
    return file


def statuses(outcome: CsvOutcome) -> dict[str, str]:
    return {verdict.channel: verdict.status for verdict in outcome.all}


@pytest.mark.parametrize(("name", "channel"), FLIPPED, ids=[name for name, _ in FLIPPED])
def test_one_sign_flipped_in_one_component_is_caught_with_channel_and_time(
    tmp_path: Path, name: str, channel: str
) -> None:
    case = shipped(name)
    reference = load_reference(case.folder)
    channels = {each: rows.copy() for each, rows in reference.channels.items()}
    good = verify_csv(case, tmp_file(tmp_path / "good.csv", reference.times, channels))
    assert set(statuses(good).values()) == {"agree"}
    moving = int(np.argmax(np.ptp(channels[channel], axis=0)))
    channels[channel][:, moving] *= -1.0
    outcome = verify_csv(case, tmp_file(tmp_path / "flipped.csv", reference.times, channels))
    (caught,) = outcome.unexpected
    assert caught.channel == channel
    assert caught.status == "differ"
    apart = distance(channel, channels[channel], reference.channels[channel])
    worst = float(reference.times[np.argmax(apart)])
    assert f"worst at t = {worst:.6g} s" in caught.reason
    assert outcome.details[channel].worst_s == worst
    if not channel.endswith(".orientation"):
        assert "of the wrong sign" in outcome.details[channel].cause


def tmp_file(file: Path, times: Real, channels: dict[str, Real]) -> Path:
    """A CSV with the columns of a reference.csv."""
    file.write_text(values_text(times, channels), encoding="utf-8")
    return file


def test_wheels_drives_energies_and_momentum_have_short_names(tmp_path: Path) -> None:
    """The template holds all that has a goal; filled in, it agrees."""
    case = shipped("wheel_gyrostat/torque_driven")
    header = sample_times_csv(case, None).splitlines()[0].split(",")
    assert {"wheel_skew.tx", "energy.total", "momentum.angular.z", "sensor.qw"} <= set(header)
    reference = load_reference(case.folder)
    columns = {
        name: rows[:, i]
        for channel, rows in reference.channels.items()
        for i, name in enumerate(short_names(channel, rows.shape[1]))
    }
    file = tmp_path / "mine.csv"
    table = np.column_stack([reference.times, *(columns[name] for name in header[1:])])
    np.savetxt(file, table, delimiter=",", header=",".join(header), comments="", fmt="%.17g")
    outcome = verify_csv(case, file)
    assert outcome.ok
    assert "wheel_load:wheel_skew.torque" in statuses(outcome)
    assert len(outcome.all) > 15
    some = {"momentum.angular": reference.channels["momentum.angular"]}
    assert verify_csv(case, write(tmp_path / "some.csv", reference.times, some)).ok


def motion(times: Real) -> dict[str, Real]:
    """A smooth path and a turning of several turns."""
    half = np.column_stack([np.sin(0.3 * times), 0.4 * np.cos(times), times])
    angle = np.linalg.norm(half, axis=1)
    turned = np.column_stack([np.cos(angle), np.sin(angle)[:, None] * half / angle[:, None]])
    return {
        "marker:tip.position": np.column_stack([np.sin(times), np.cos(1.3 * times), times**2]),
        "marker:tip.orientation": turned,
    }


@pytest.mark.parametrize("count", [100, 200, 400])
def test_what_interpolation_adds_bounds_its_error(count: int) -> None:
    wanted, given = np.linspace(0.0, 10.0, 51), np.linspace(0.0, 10.0, count)
    known = motion(given)
    jumping = np.where(np.arange(count) % 3 == 0, -1.0, 1.0)  # q and -q are one orientation
    known["marker:tip.orientation"] *= jumping[:, None]
    found, doubts = resample(known, given, wanted)
    for name, rows in motion(wanted).items():
        error = float(np.max(distance(name, found[name], rows)))
        assert error <= doubts[name]
        assert doubts[name] < 0.2 * (100.0 / count) ** 3


def test_times_that_are_there_are_taken_over() -> None:
    given = np.linspace(0.0, 10.0, 251)
    found, doubts = resample(motion(given), given, given[::5])
    np.testing.assert_array_equal(found["marker:tip.position"], motion(given)["marker:tip.position"][::5])
    assert not doubts


def gyrostat_at(times: Real) -> dict[str, Real]:
    """The reference of the free gyrostat at other times, by another interpolation than that which is judged."""
    from scipy.interpolate import make_interp_spline

    reference = load_reference(shipped_folder() / "wheel_gyrostat" / "torque_free")
    names = ("marker:sensor.position", "marker:sensor.velocity", "marker:sensor.orientation")
    return {name: make_interp_spline(reference.times, reference.channels[name], k=7)(times) for name in names}


def test_a_grid_of_its_own_is_judged_with_what_interpolation_adds(tmp_path: Path) -> None:
    case = shipped("wheel_gyrostat/torque_free")
    fine = np.linspace(0.0, 10.0, 1777)
    outcome = verify_csv(case, write(tmp_path / "fine.csv", fine, gyrostat_at(fine)))
    assert set(statuses(outcome).values()) == {"agree"}
    assert "1777 samples at times of its own" in outcome.interpolated
    rough = np.linspace(0.0, 10.0, 40)
    outcome = verify_csv(case, write(tmp_path / "rough.csv", rough, gyrostat_at(rough)))
    assert set(statuses(outcome).values()) == {"unresolved"}
    assert "interpolation" in outcome.all[0].reason
    wrong = gyrostat_at(fine)
    wrong["marker:sensor.velocity"][:, 1] *= -1.0
    (caught,) = verify_csv(case, write(tmp_path / "wrong.csv", fine, wrong)).unexpected
    assert caught.channel == "marker:sensor.velocity"  # positions do not suffer from it
    assert caught.status == "differ"


@pytest.mark.parametrize(("times", "said"), [
    (np.linspace(0.0, 9.0, 500), "do not cover the case's"),
    (np.linspace(0.5, 10.0, 500), "do not cover the case's"),
    (np.linspace(0.0, 10.0, 7), "only 7 rows"),
])  # fmt: skip
def test_times_that_do_not_cover_the_reference_are_refused(tmp_path: Path, times: Real, said: str) -> None:
    file = write(tmp_path / "mine.csv", times, gyrostat_at(times))
    with pytest.raises(VerifyError, match=said):
        verify_csv(shipped("wheel_gyrostat/torque_free"), file)


def test_the_coarse_file_has_times_of_its_own_too(tmp_path: Path) -> None:
    case = shipped("wheel_gyrostat/torque_free")
    reference = load_reference(case.folder)
    position = {"marker:sensor.position": reference.channels["marker:sensor.position"]}
    mine = write(tmp_path / "mine.csv", reference.times, position)
    off = {name: rows * (1.0 + 1e-9) for name, rows in position.items()}
    near = write(tmp_path / "near.csv", reference.times, off)
    outcome = verify_csv(case, mine, coarse=near)
    assert outcome.ok
    assert 1e-9 < outcome.all[0].U < 1e-8


def test_json_and_the_command(tmp_path: Path) -> None:
    case = shipped("wheel_gyrostat/torque_free")
    reference = load_reference(case.folder)
    file = write(tmp_path / "mine.csv", reference.times, {"momentum.angular": reference.channels["momentum.angular"]})
    answer = CliRunner().invoke(app, ["verify", "torque_free", str(file), "--json"])
    assert answer.exit_code == 0
    found = json.loads(answer.stdout)
    assert found == json.loads(outcome_json(verify_csv(case, file)))
    assert found["channels"]["momentum.angular"]["status"] == "agree"
    shown = CliRunner().invoke(app, ["verify", "torque_free", str(file)], env={"COLUMNS": "200"})
    assert "Held against the stored reference of variant rigid, to 10 s." in shown.stdout
