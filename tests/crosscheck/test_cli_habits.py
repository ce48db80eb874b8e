"""Habits of the command lines: versions, JSON and nothing else on stdout, how much is shown, completion, comparing, and
readers that go away (`crosscheck run ... | head -1`): a command goes on, and ends as if all had been read."""

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from typer.main import get_command
from typer.testing import CliRunner

import flexmb.cli
from crosscheck import cli
from crosscheck.library import find
from crosscheck.library.find import load_case
from crosscheck.running.installed import EngineState
from crosscheck.sealed.seal import read_results
from tests.crosscheck.sessions import CASE, copy_case, sweep_here
from tests.repo.project import ROOT


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Records of the small case, run once."""
    file = tmp_path_factory.mktemp("records") / "records.jsonl"
    sweep_here((find.load_case(CASE),), (), file)
    return file


@pytest.fixture
def runner(monkeypatch: pytest.MonkeyPatch) -> CliRunner:
    monkeypatch.setattr(cli.common.console, "_width", 200)
    return CliRunner()


def report(runner: CliRunner, records: Path, out: Path, *words: str):
    return runner.invoke(cli.app, ["report", str(records), "--out", str(out), *words])


def test_report_prints_its_results_as_json(runner: CliRunner, records: Path, tmp_path: Path) -> None:
    result = report(runner, records, tmp_path, "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["headline"] == "All 15 verdicts are as expected"
    assert result.stdout == (tmp_path / "results.json").read_text(encoding="ascii")
    assert "All 15 verdicts are as expected" in result.stderr
    again = report(runner, records, tmp_path)
    assert "All 15 verdicts are as expected" in again.stdout, "--json of one call must not outlive it"


def test_some_ten_lines_unless_more_or_less_is_asked_for(runner: CliRunner, records: Path, tmp_path: Path) -> None:
    normal = report(runner, records, tmp_path).stdout.splitlines()
    assert normal[0].startswith("1 case: ") and normal[0].endswith("deliberate faults noticed")
    assert normal[1] == "All 15 verdicts are as expected" and len(normal) == 4
    assert normal[2].startswith("Report: ") and normal[3].startswith("Records: ")
    assert report(runner, records, tmp_path, "--quiet").stdout.splitlines() == ["All 15 verdicts are as expected"]
    verbose = report(runner, records, tmp_path, "--verbose").stdout
    assert "rigid, all engines" in verbose and "negative controls" in verbose
    assert report(runner, records, tmp_path, "--quiet", "--verbose").exit_code == 2


def test_colour_is_for_terminals(runner: CliRunner, records: Path, tmp_path: Path) -> None:
    assert "\x1b[" not in report(runner, records, tmp_path, "--verbose").output


def test_errors_leave_stdout_empty(runner: CliRunner, tmp_path: Path) -> None:
    result = runner.invoke(cli.app, ["run", "nowhere", "--out", str(tmp_path), "--json"])
    assert (result.exit_code, result.stdout) == (2, "")
    assert "crosscheck list" in result.stderr


def test_lists_are_json_too(runner: CliRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    cases = json.loads(runner.invoke(cli.app, ["list", "--json"]).stdout)
    assert [case["name"] for case in cases] == list(find.shipped_names())
    assert all(case["variants"] and case["title"] for case in cases)
    states = [EngineState("fine", "1.0", "", "a pendulum"), EngineState("absent", None, "pip install it")]
    monkeypatch.setattr("crosscheck.running.installed.describe_engines", lambda: states)
    found = json.loads(runner.invoke(cli.app, ["engines", "--json"]).stdout)
    assert [each["version"] for each in found] == ["1.0", None]
    assert [each["problem"] for each in found] == ["", "not installed"]
    maps = json.loads(runner.invoke(cli.app, ["stability", "list", "--json"]).stdout)
    assert "vibrating_hinge" in maps and maps["vibrating_hinge"]["overlay"]


def test_versions_of_both_commands(runner: CliRunner, monkeypatch: pytest.MonkeyPatch) -> None:
    states = [EngineState("native", "0.1.0", ""), EngineState("pinocchio", None, "pip install it")]
    monkeypatch.setattr("crosscheck.running.installed.describe_engines", lambda: states)
    said = runner.invoke(cli.app, ["--version"]).stdout.splitlines()
    assert said[0].startswith("crosscheck ") and said[1].startswith("Python 3.")
    assert said[2:] == ["native: 0.1.0", "pinocchio: not installed"]
    said = CliRunner().invoke(flexmb.cli.app, ["--version"]).stdout.splitlines()
    assert said[0].startswith("flexmb ") and any(line.startswith("numba ") for line in said)


@pytest.mark.parametrize("app", [cli.app, flexmb.cli.app])
def test_both_commands_complete_themselves(app) -> None:
    options = {name for parameter in get_command(app).params for name in parameter.opts}
    assert {"--version", "--install-completion", "--show-completion"} <= options


@pytest.mark.parametrize(
    ("line", "expected"),
    [("crosscheck run closed", "closed_chains/four_bar"), ("crosscheck run all -e pino", "pinocchio"),
     ("crosscheck contract muj", "mujoco"), ("crosscheck com", "compare")],
)  # fmt: skip
def test_names_are_completed(line: str, expected: str) -> None:
    asked = {"_CROSSCHECK_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(line.split()) - 1)}
    result = CliRunner().invoke(cli.app, [], prog_name="crosscheck", env=asked)
    assert expected in result.stdout.split(), result.output


def test_compare_says_what_became_worse(runner: CliRunner, records: Path, tmp_path: Path) -> None:
    report(runner, records, tmp_path / "old")
    old = tmp_path / "old" / "results.json"
    same = runner.invoke(cli.app, ["compare", str(old), str(old)])
    assert (same.exit_code, same.stdout) == (0, "0 worse, 0 gone, 0 better, 0 new, 15 the same\n")
    lines = records.read_text(encoding="utf-8").splitlines(keepends=True)
    fewer = tmp_path / "records.jsonl"
    fewer.write_text("".join(lines[:-1]), encoding="utf-8")  # the last run is lost
    report(runner, fewer, tmp_path / "new")
    new = tmp_path / "new" / "results.json"
    worse = runner.invoke(cli.app, ["compare", str(old), str(new)])
    assert worse.exit_code == 1 and "worse: pendulum/single" in worse.stdout, worse.output
    as_json = json.loads(runner.invoke(cli.app, ["compare", str(old), str(new), "--json"]).stdout)
    assert as_json["regressed"] and {change["direction"] for change in as_json["changes"]} == {"worse"}
    new.write_text(new.read_text(encoding="ascii").replace('"exit_code":1', '"exit_code":0'), encoding="ascii")
    tampered = runner.invoke(cli.app, ["compare", str(old), str(new)])
    assert tampered.exit_code == 2 and "was changed after it was written" in tampered.stderr


def test_run_writes_what_can_be_compared(runner: CliRunner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("crosscheck.running.sweep.sweep", sweep_here)
    result = runner.invoke(cli.app, ["run", str(CASE), "--out", str(tmp_path), "--quiet"])
    assert (result.exit_code, result.stdout) == (0, "All 15 verdicts are as expected\n")
    assert read_results(tmp_path / "results.json").exit_code == 0
    assert {"badge.svg", "badge.json"} <= {file.name for file in tmp_path.iterdir()}


COMMANDS = {
    "crosscheck list": 0, "crosscheck engines --json": 0, "crosscheck report GREEN --out OUT --verbose": 0,
    "crosscheck report RED --out OUT --verbose": 1, "crosscheck report no-such-file": 2, "flexmb schema": 0,
    "flexmb check SCENE": 0, "flexmb check no-such-file": 2, "flexmb": 2,
}  # fmt: skip
ALIKE = ("crosscheck engines --json", "crosscheck report no-such-file", "flexmb schema", "flexmb check no-such-file")
ENVIRONMENT = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "200"}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Records of a green session and of a red one, by the words that stand for them."""
    folder = tmp_path_factory.mktemp("records")
    case = load_case(copy_case(folder))
    red = msgspec.structs.replace(case.run.comparisons[0], goals={"energy": 1e-16})
    sweep_here([case], (), folder / "green.jsonl")
    object.__setattr__(case, "run", msgspec.structs.replace(case.run, comparisons=(red, *case.run.comparisons[1:])))
    sweep_here([case], (), folder / "red.jsonl")
    return {
        "GREEN": str(folder / "green.jsonl"), "RED": str(folder / "red.jsonl"), "SCENE": str(CASE / "scene.toml"),
        "OUT": str(folder / "out"),
    }  # fmt: skip


def line_of(command: str, files: dict[str, str]) -> str:
    package, *words = (files.get(word, word) for word in command.split())
    return shlex.join([sys.executable, "-c", f"from {package}.cli import main; main()", *words])


@pytest.mark.parametrize(
    "command", [pytest.param(command, marks=pytest.mark.slow if command in ALIKE else []) for command in COMMANDS]
)
def test_nobody_reads_at_all(command: str, files: dict[str, str]) -> None:
    """Both streams are closed before the first word: the exit code is that of the command, and nothing complains."""
    line = f"({line_of(command, files)}; echo $? >&3) 3>&1 1>&4 2>&4"
    gone, writer = os.pipe()
    os.close(gone)
    done = subprocess.run(
        ["bash", "-c", line.replace("&4", f"&{writer}")], env=ENVIRONMENT, stdout=subprocess.PIPE, text=True,
        pass_fds=[writer], timeout=120,
    )  # fmt: skip
    os.close(writer)
    assert done.stdout == f"{COMMANDS[command]}\n"


@pytest.mark.parametrize(("records", "code"), [("GREEN", 0), ("RED", 1)])
def test_a_pipeline_fails_where_a_verdict_does(records: str, code: int, files: dict[str, str], tmp_path: Path) -> None:
    """As continuous integration pipes, with pipefail: all files are written though nobody reads a word.

    `head -1` would do, but may read slowly enough for all to be written before it goes.
    """
    line = line_of(f"crosscheck report {records} --out OUT --verbose", files | {"OUT": str(tmp_path)})
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", f"{line} | true"], env=ENVIRONMENT, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr, done.stdout) == (code, "", "")
    assert read_results(tmp_path / "results.json").exit_code == code
    assert (tmp_path / "report" / "index.html").exists()
