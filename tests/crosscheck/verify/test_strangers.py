"""Strangers' files against stored references, for which no engine runs: what agrees, and what is caught where."""

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
from crosscheck.verify.columns import short_names
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

    monkeypatch.setattr("crosscheck.references.routes.run_planned", refuse)
    monkeypatch.setattr("crosscheck.verify.target.run_planned", refuse)


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


def test_the_coarse_file_gives_the_uncertainty(tmp_path: Path) -> None:
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
