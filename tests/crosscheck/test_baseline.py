"""`crosscheck run` for an outside engine: goals and efforts of its own, and a baseline since which nothing is worse."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.sealed.seal import read_results
from tests.crosscheck.sessions import copy_case, engines_here, sweep_here, versus

RUN_FILE = versus("fine", "second", goals='"marker:tip.position" = 1e-6, "load" = 1e-6')
EXPECT = """
[[goal]]
engine = "sloppy"
cases = ["pendulum/*"]
goals = { "*" = 0.5 }
reason = "its steps are long"
"""


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Runs `crosscheck run` on the small case in a folder of its own; the exit code and what was shown."""
    monkeypatch.setattr("crosscheck.running.sweep.sweep", sweep_here)
    monkeypatch.setattr("crosscheck.running.installed.require_engines", engines_here)
    monkeypatch.setattr(cli.common.console, "_width", 300)
    monkeypatch.chdir(tmp_path)
    case = copy_case(tmp_path / "cases", RUN_FILE)

    def invoke(engine: str, *words: str, out: str = "out") -> tuple[int, str]:
        command = ["run", str(case), "-e", engine, "--out", str(tmp_path / out), *words]
        result = CliRunner().invoke(cli.app, command, env={"COLUMNS": "300"})
        return result.exit_code, result.output

    return invoke


def test_a_coarse_engine_is_green_by_goals_of_its_own_and_says_so(run, tmp_path: Path) -> None:
    code, output = run("sloppy")
    assert code == 1 and "crosscheck run pendulum/single --engine sloppy --efforts sloppy=" in output
    Path("crosscheck-expect.toml").write_text(EXPECT, encoding="utf-8")
    code, output = run("sloppy")
    assert code == 0, output
    assert "Expectations: crosscheck-expect.toml" in output and "by goals looser than the case's" in output
    assert "looser than the case's: sloppy: its steps are long" in output
    sealed = read_results(tmp_path / "out" / "results.json").cases["pendulum/single"]
    assert sealed.claims is not None and sealed.claims.goals[0].place == "crosscheck-expect.toml: $.goal[0]"
    (verdict, *_) = sealed.verdicts["all"].values()
    assert (verdict.goal, verdict.case_goal) == (0.5, 1e-6)
    page = (tmp_path / "out" / "report" / "pendulum" / "single.html").read_text(encoding="utf-8")
    assert "looser goal" in page and "of the case: 1.0e-06" in page
    again = CliRunner().invoke(cli.app, ["report", "out/records.jsonl", "--out", "again"])
    assert again.exit_code == 0 and "looser than the case's" in again.output, "the records hold the claims"
    Path("crosscheck-expect.toml").unlink()
    assert run("sloppy")[0] == 1, "without the file nothing is left of it"
    assert run("sloppy", "--goal", "sloppy=0.5")[0] == 0


def test_the_advised_efforts_do(run, tmp_path: Path) -> None:
    _, output = run("sloppy")
    advice = next(line for line in output.splitlines() if "--efforts" in line)
    option = advice.partition("--efforts ")[2].split()[0]
    code, output = run("sloppy", "--efforts", option)
    assert code == 0, output
    records = [json.loads(line) for line in (tmp_path / "out" / "records.jsonl").read_text().splitlines()]
    ladder = {
        record["effort_value"] for record in records if record.get("engine") == "sloppy" and record["role"] == "main"
    }
    assert {float(value) for value in option.partition("=")[2].split(",")} < ladder
    assert run("sloppy")[0] == 1, "the shorter ladder counts again, though the longer one is recorded"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--goal", "slopy=0.5"], 'there is no engine "slopy"'),
        (["--goal", "sloppy=nan"], "nan is no part of the range"),
        (["--efforts", "sloppy=0"], "0 makes no sense"),
        (["--expect", "none.toml"], "none.toml"),
        (["--baseline", "out"], "the session would overwrite it"),
        (["--baseline", "bad.json"], "bad.json"),
    ],
)
def test_nonsense_is_refused_before_anything_runs(run, tmp_path: Path, words: list[str], message: str) -> None:
    Path("bad.json").write_text("{}", encoding="utf-8")
    code, output = run("sloppy", *words)
    assert (code, message in output) == (2, True), output
    assert not (tmp_path / "out").exists()


def test_only_what_became_worse_since_the_baseline_fails(run, tmp_path: Path) -> None:
    code, output = run("sloppy", "--baseline", "kept")
    assert code == 0 and "There was no baseline: this session is it now" in output
    kept = (tmp_path / "kept" / "results.json").read_bytes()
    code, output = run("sloppy", "--baseline", "kept")
    assert code == 0 and "Nothing is worse than the baseline" in output
    assert "Nothing is worse than the baseline" in (tmp_path / "out" / "summary.md").read_text(encoding="utf-8")
    assert json.loads((tmp_path / "out" / "results.json").read_text())["exit_code"] == 1
    code, output = run("sloppy", "--goal", "sloppy:load=0.5", "--baseline", "kept/results.json")
    assert code == 0 and "judged by other goals" in output
    assert (tmp_path / "kept" / "results.json").read_bytes() == kept, "better or not, it is replaced by hand"


def test_worse_new_and_missing_fail(run, tmp_path: Path) -> None:
    assert run("fine", "--baseline", "kept")[0] == 0
    for engine in ("biased", "refuser"):
        code, output = run(engine, "--baseline", "kept", out=engine)
        assert code == 1 and "Worse than the baseline" in output, engine
    assert "❌ Worse" in (tmp_path / "biased" / "summary.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("engine", ["absent", "no-such-engine"])
def test_an_engine_that_is_not_there_is_refused_beside_a_baseline_too(run, tmp_path: Path, engine: str) -> None:
    code, output = run(engine, "--baseline", "kept")
    assert (code, f'engine "{engine}"' in output or f"engine {engine} is not installed" in output) == (2, True), output
    assert not (tmp_path / "kept").exists() and not (tmp_path / "out").exists()


def test_a_session_that_shows_nothing_is_no_baseline(run, tmp_path: Path) -> None:
    code, output = run("refuser", "--baseline", "kept")
    assert code == 1 and "this session cannot be one" in output
    assert not (tmp_path / "kept").exists()


def test_a_claim_that_names_nothing_fails_whatever_was_before(run) -> None:
    assert run("fine", "--baseline", "kept")[0] == 0
    text = EXPECT.replace("sloppy", "fine").replace('"*" = 0.5', "wheel_load = 0.5")
    Path("crosscheck-expect.toml").write_text(text.replace("pendulum/*", "pendulum/single"), encoding="utf-8")
    code, output = run("fine", "--baseline", "kept")
    assert code == 1 and '"wheel_load" names no channel of fine' in output
