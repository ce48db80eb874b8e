"""A command that is killed leaves nothing of the session before it that would pass for its own."""

import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.library.find import load_case
from crosscheck.records.archive import read
from crosscheck.records.kinds import RunRecord
from crosscheck.report.ci import VERDICTS
from crosscheck.sealed.seal import read_results
from tests.crosscheck.running.interrupted import EFFORTS, MAIN, RUN_FILE, install_plugs
from tests.crosscheck.sessions import CASE, copy_case, sweep_here, versus
from tests.repo.project import ROOT

WIDE = {"COLUMNS": "200"}


def says_unfinished(out: Path) -> None:
    """Every output of a session says that it is unfinished, or is not there."""
    results = read_results(out / "results.json")
    assert (results.unfinished, results.exit_code, results.cases) == (True, 1, {})
    for name in ("report.html", "report/index.html", "summary.md"):
        text = (out / name).read_text(encoding="utf-8")
        assert "Unfinished" in text and "as expected<" not in text, name
    (suite,) = ElementTree.parse(out / "junit.xml").getroot()
    assert (suite.get("tests"), suite.get("failures")) == ("1", "1")
    assert json.loads((out / "badge.json").read_text("ascii"))["message"] == "unfinished"
    assert "unfinished" in (out / "badge.svg").read_text("utf-8")
    assert not (out / VERDICTS).exists()
    assert [each.name for each in (out / "report").rglob("*") if each.is_file()] in (
        ["index.html", "pages.json"], ["pages.json", "index.html"],
    )  # fmt: skip


def test_a_killed_session_is_unfinished_and_goes_on(green: Path, tmp_path: Path) -> None:
    plugs = tmp_path / "plugs"
    plugs.mkdir()
    gate, case = install_plugs(plugs), copy_case(tmp_path, RUN_FILE)
    run = [sys.executable, "-c", MAIN, "run", str(case), "--out", str(green), "--jobs", "2"]
    options = {"env": os.environ | {"PYTHONPATH": os.pathsep.join([str(plugs), str(ROOT)])}, "stdout": subprocess.PIPE}
    (green / ".part-of a kill").touch()

    gate.touch()
    killed = subprocess.Popen([*run, "--fresh"], **options)
    deadline = time.monotonic() + 120.0
    while runs(green) != EFFORTS and time.monotonic() < deadline:  # of the first engine; the other waits
        time.sleep(0.1)
    killed.send_signal(signal.SIGKILL)
    killed.communicate()
    assert runs(green) == EFFORTS
    says_unfinished(green)
    assert not (green / ".part-of a kill").exists()
    code, said = crosscheck("report", str(green / "records.jsonl"), "--out", str(tmp_path / "later"))
    assert code == 1 and "patient did not run" in said, said
    killed_results, earlier = green / "results.json", tmp_path / "later" / "results.json"
    for both in ((killed_results, earlier), (earlier, killed_results)):
        code, said = crosscheck("compare", *map(str, both))
        assert code == 2 and "is unfinished, begun at 20" in said, said

    gate.unlink()
    done = subprocess.run(run, **options, timeout=120.0)
    assert done.returncode == 0, done.stdout
    assert read_results(green / "results.json").exit_code == 0 and runs(green) == 2 * EFFORTS
    assert "as expected" in (green / "report" / "index.html").read_text(encoding="utf-8")


def crosscheck(*words: str) -> tuple[int, str]:
    result = CliRunner().invoke(cli.app, words, env=WIDE)
    return result.exit_code, result.output


def runs(out: Path) -> int:
    """How many runs are recorded."""
    file = out / "records.jsonl"
    return sum(isinstance(each, RunRecord) for each in (read(file) if file.exists() else ()))


class Killed(BaseException):
    """Ends a command at once, as a signal would."""


def killed(*_: object, **__: object) -> None:
    raise Killed


@pytest.fixture
def green(tmp_path: Path) -> Path:
    """A folder in which every command has left what it leaves when all is well."""
    out = tmp_path / "out"
    (out / "report" / "assets").mkdir(parents=True)
    for name in ("results.json", "junit.xml", "summary.md", "badge.json", "badge.svg", VERDICTS, "report.html"):
        (out / name).write_text("green", encoding="utf-8")
    (out / "report" / "assets" / "pages.json").write_text('["index.html"]', encoding="utf-8")
    for name in ("records.jsonl", "report/index.html", "mutation.json", "invariance.json", "summary.json"):
        (out / name).write_text("green", encoding="utf-8")
    for name in ("samples.csv", "bench.json", "index.html", "definiteness.svg"):
        (out / name).write_text("green", encoding="utf-8")
    (out / "maps.json").write_text("[]", encoding="utf-8")
    return out


def test_a_session_says_unfinished_before_it_touches_the_records(green: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("crosscheck.running.sweep.sweep", killed)
    with pytest.raises(Killed):
        CliRunner().invoke(cli.app, ["run", str(CASE), "--out", str(green), "--fresh"], catch_exceptions=False)
    says_unfinished(green)
    assert (green / "records.jsonl").read_text("utf-8") == "green"


@pytest.mark.parametrize(
    ("place", "words", "gone"),
    [
        (
            "crosscheck.mutation.campaign.run_planned", ["mutate", str(CASE), "-e", "native", "-o", "OUT"],
            ["mutation.json"],
        ),
        (
            "crosscheck.mutation.invariance_runs.run_planned", ["invariance", str(CASE), "-e", "native", "-o", "OUT"],
            ["invariance.json"],
        ),
        (
            "crosscheck.terminal.many_runs.run_map", ["stability", "definiteness", "-o", "OUT"],
            ["definiteness.svg", "maps.json"],
        ),
        ("crosscheck.sampling.run._jobs", ["sweep", "SWEEP", "-o", "OUT"], ["samples.csv", "summary.json"]),
        ("crosscheck.timing.bench.bench", ["bench", str(CASE), "--json", "OUT/bench.json"], ["bench.json"]),
        ("crosscheck.timing.chart.chart", ["chart", str(CASE), "-o", "OUT"], ["index.html"]),
    ],
)  # fmt: skip
def test_what_a_command_will_write_is_taken_away_before_it_begins(
    green: Path, monkeypatch: pytest.MonkeyPatch, place: str, words: list[str], gone: list[str]
) -> None:
    sweep = green.parent / "sweep.toml"
    sweep.write_text(SWEEP.format(scene=CASE / "scene.toml"), encoding="utf-8")
    copied = green.parent / "pendulum" / "single"
    copy_case(green.parent, NATIVE)
    given = {"OUT": str(green), "SWEEP": str(sweep), str(CASE): str(copied)}
    for old, new in given.items():
        words = [word.replace(old, new) for word in words]
    monkeypatch.setattr(place, killed)
    assert all((green / name).exists() for name in gone)
    with pytest.raises(Killed):
        CliRunner().invoke(cli.app, words, catch_exceptions=False)
    assert not any((green / name).exists() for name in gone)


NATIVE = versus("native", "pinocchio")
SWEEP = """
title = "Where the rod is"
scene = "{scene}"
engines = ["native"]
duration_s = 1.0
samples = 11
number = 2
seed = 1

[[parameter]]
name = "angle"
path = "hinges.pivot.rotation.angle_rad"
distribution = "normal"
mean = 1.0
sd = 0.1

[[quantity]]
name = "tip"
channel = "marker:tip.position"
component = "y"
value = "final"
"""


def test_a_report_that_does_not_fit_on_the_disk_is_no_green_one(green: Path, tmp_path: Path) -> None:
    """Held to files of 3000 bytes: what is there is whole, and nothing of it is of the session before."""
    records = tmp_path / "records.jsonl"
    sweep_here([load_case(copy_case(tmp_path))], (), records)
    done = subprocess.run(
        [sys.executable, "-c", MAIN, "report", str(records), "--out", str(green)], text=True, capture_output=True,
        env=os.environ | WIDE | {"PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(ROOT)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (3000, 3000)),
    )  # fmt: skip
    assert done.returncode == 2, done
    assert "File too large: it was not written" in done.stderr and "Traceback" not in done.stderr
    left = {each.relative_to(green).as_posix(): each.read_text("utf-8") for each in green.rglob("*") if each.is_file()}
    assert not any(".part-" in name for name in left)
    made = {"results.json", "report.html", "report/index.html", "badge.svg", "junit.xml", "summary.md"}
    assert not [name for name in made if left.get(name) == "green"]
    assert read_results(green / "results.json").unfinished
