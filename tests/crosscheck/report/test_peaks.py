"""Peaks: over all steps where a session has them, else of samples, which says so; and files that show them."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from crosscheck.engines.extremes import ROWS, components, has_extremes, of_samples, width
from crosscheck.judging.peaks import peaks
from crosscheck.judging.results import collect
from crosscheck.library.channels import KINDS
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.kinds import ENVELOPE, RunRecord
from crosscheck.records.packing import pack
from crosscheck.records.session import last_session
from crosscheck.report import write_all
from crosscheck.sealed.seal import read_results
from tests.crosscheck.report.reading import data_of
from tests.crosscheck.sessions import copy_case, sweep_here, versus

RUN = versus("fine", "stepper", goals='"marker:tip.position" = 1e-6, "load" = 1e-6')


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("crosscheck.running.plan.OWN_CODE", ("fine",))
    return tmp_path


def session(folder: Path, envelopes: bool) -> Path:
    case = folder / "pendulum" / "single"
    case = case if case.exists() else copy_case(folder, RUN)
    sweep_here([replace(load_case(case), envelopes=envelopes)], (), folder / "records.jsonl")
    outcome, page = write_all(folder / "records.jsonl", folder, chosen=last_session)
    assert outcome.ok
    return page.parent / "pendulum" / "single.html"


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "envelope.csv").open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    names = [f"{name} {i}" if header.count(name) > 1 else name for i, name in enumerate(header)]
    return [dict(zip(names, row, strict=True)) for row in rows]


def test_peaks_lie_between_samples_and_files_say_over_what(folder: Path) -> None:
    page = session(folder, envelopes=True).read_text(encoding="utf-8")
    rows = rows_of(folder)
    assert {row["over"] for row in rows if row["engine"] == "fine"} == {"all steps"}
    assert {row["over"] for row in rows if row["engine"] == "stepper"} == {"21 samples"}
    assert all((row["error"] == "") == (row["over"] != "all steps") for row in rows)

    def peak(engine: str) -> tuple[float, float]:
        (row,) = (r for r in rows if (r["engine"], r["channel"], r["component"]) == (
            engine, "load:pivot.force", "magnitude"))  # fmt: skip
        return float(row["greatest"]), float(row["at [s] 9"])

    (whole, at), (sampled, _) = peak("fine"), peak("stepper")
    assert whole > sampled and 0.0 < at < 2.0
    sealed = read_results(folder / "results.json").cases["pendulum/single"]
    assert sealed.peaks["rigid | fine | load:pivot.force"] == (float(f"{whole:.4g}"), float(f"{at:.6g}"))
    assert not any("stepper" in key for key in sealed.peaks) and not any(ENVELOPE in key for key in sealed.runs)
    table = re.findall(r"<td>rigid</td><th scope=.row.>load:pivot.force</th>(.*)", page)
    assert f"{whole:.6g} N" in table[0] and "all steps" in table[0]
    assert f"{sampled:.6g} N" in table[1] and "21 samples" in table[1]
    page = session(folder, envelopes=False)  # leaves no file of an earlier one
    assert not (folder / "envelope.csv").exists() and "all steps" not in page.read_text(encoding="utf-8")
    assert "peaks" not in json.loads((folder / "results.json").read_text(encoding="ascii"))["cases"]["pendulum/single"]
    session(folder, envelopes=True)  # it is not run again
    made = [r for r in read(folder / "records.jsonl") if isinstance(r, RunRecord) and r.role == ENVELOPE]
    assert (folder / "envelope.csv").exists() and len(made) == 1


def test_an_envelope_that_was_asked_for_and_failed_is_not_as_expected(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def short(self, run, effort):
        return {"load:pivot.force": np.zeros((ROWS, 4))}

    monkeypatch.setattr("tests.crosscheck.fake_engines.Pendulum.extremes", short)
    with pytest.raises(AssertionError):
        session(folder, envelopes=True)
    said = (folder / "summary.md").read_text(encoding="utf-8")
    assert "envelope" in said and "does not contain the run" in said
    assert {row["over"].partition(",")[0] for row in rows_of(folder)} == {"21 samples"}
    (failed,) = {row["over"] for row in rows_of(folder) if row["engine"] == "fine"}
    assert "its envelope failed: broke the contract" in failed


def test_every_kind_of_channel_has_extremes_or_says_that_it_has_none() -> None:
    times, seen = np.linspace(0.0, 1.0, 5), 0
    for kind in KINDS:
        for part in kind.parts:
            name = ".".join(filter(None, (f"{kind.name}:item" if kind.of_items else kind.name, part.name)))
            if not has_extremes(name):
                assert part.name == "orientation" or kind.name in ("derivatives", "known_to")
                continue
            values = np.outer(np.array([0.0, 2.0, -3.0, 1.0, 0.0]), np.ones(part.width or 2))
            found = of_samples(name, times, values)
            assert found.shape == (ROWS, width(name, values.shape[1]))
            assert len(components(name, found.shape[1])) == found.shape[1]
            assert found[0, 0] == -3.0 and found[1, 0] == 0.5 and found[2, 0] == 2.0 and found[3, 0] == 0.25
            seen += 1
    assert seen > 15


def test_rounding_is_not_drawn_as_a_signal(folder: Path) -> None:
    """The pendulum's torque about its pivot is zero beside its force of 20 N; events are marked."""
    file = folder / "records.jsonl"
    session(folder, envelopes=False)
    text = file.read_text(encoding="utf-8")
    noise_of_torque = 1e-15 * np.random.default_rng(1).normal(size=(21, 3))
    noise = pack(noise_of_torque)
    lines = []
    for line in text.splitlines():
        record = json.loads(line)
        if record["record"] == "run" and record["status"] == "finished":
            record["channels"]["load:pivot.torque"] = {"shape": list(noise.shape), "data": noise.data}
            record["events"] = [["latch", 0.7]]
        lines.append(json.dumps(record))
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    _, page = write_all(file, folder)
    data = data_of(page.parent / "pendulum" / "single.data.js")
    (loads,) = (panel for panel in data["panels"] if panel["title"] == "Hinge loads")
    by_name = {channel["name"]: channel for channel in loads["channels"]}
    assert by_name["load:pivot.force"]["range"] is None and by_name["load:pivot.force"]["events"] == [0.7]
    low, high = by_name["load:pivot.torque"]["range"]
    assert high == -low > 100.0 * np.abs(noise_of_torque).max() and high < 1e-9 * 20.0
    assert [peak.t for peak in peaks(collect(read(file)).cases[0]) if peak.channel == "load:pivot.torque"]
