"""The GitHub Action is valid, and its script does what it says, run here with the files that a runner would give it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.crosscheck.fake_project import fake_project
from tests.repo.project import ROOT

ACTION = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
(STEP,) = ACTION["runs"]["steps"]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fake_project(tmp_path_factory.mktemp("project"))


def act(project: Path, folder: Path, **inputs: str) -> tuple[int, str, dict[str, str]]:
    """Run the step; its exit code, the job's summary, the outputs."""
    values = {name: str(each.get("default", "")) for name, each in ACTION["inputs"].items()} | inputs
    given = {name: values[text.removeprefix("${{ inputs.").removesuffix(" }}")] for name, text in STEP["env"].items()}
    summary, outputs = folder / "summary", folder / "outputs"
    given |= {"GITHUB_STEP_SUMMARY": str(summary), "GITHUB_OUTPUT": str(outputs)}
    given |= {"PYTHON": sys.executable, "PYTHONPATH": os.pathsep.join([str(project), str(ROOT)])}
    shell = ["bash", "-eo", "pipefail", "-c", STEP["run"]]  # as runners start it
    run = subprocess.run(shell, cwd=folder, env=os.environ | given, capture_output=True, text=True, check=False)
    lines = outputs.read_text(encoding="utf-8").splitlines() if outputs.exists() else []
    told = summary.read_text(encoding="utf-8") if summary.exists() else run.stdout + run.stderr
    return run.returncode, told, dict(line.split("=", 1) for line in lines)


def test_it_is_a_composite_action() -> None:
    assert {"name", "description", "inputs", "outputs", "runs"} <= set(ACTION)
    assert ACTION["runs"]["using"] == "composite" and STEP["shell"] == "bash"
    assert all(each["description"] for each in (*ACTION["inputs"].values(), *ACTION["outputs"].values()))
    assert "${{" not in STEP["run"], "values of inputs reach the script as variables only"
    assert {text.split(".")[1].split()[0] for text in STEP["env"].values()} == set(ACTION["inputs"])


def test_a_sound_engine_is_green_and_a_wrong_one_red(project: Path, tmp_path: Path) -> None:
    case = str(project / "pendulum" / "single")
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    code, summary, outputs = act(project, first, cases=case, engines="stepper")
    assert (code, outputs["exit-code"], outputs["results"]) == (0, "0", "out/results.json"), summary
    assert "verdicts are as expected" in summary
    baseline = first / outputs["results"]
    assert json.loads(baseline.read_text(encoding="ascii"))["exit_code"] == 0
    code, summary, _ = act(project, second, cases=case, engines="biased", baseline=str(baseline))
    assert code == 1
    assert "Not as expected" in summary and "❌ Worse than the baseline" in summary


def test_what_was_wrong_before_does_not_fail_with_a_baseline(project: Path, tmp_path: Path) -> None:
    """A first session passes and is the baseline; the next one is as wrong, and passes too."""
    case = str(project / "pendulum" / "single")
    for told in ("verdicts are not as expected", "✅ Nothing is worse than the baseline"):
        code, summary, outputs = act(project, tmp_path, cases=case, engines="biased", baseline="kept/results.json")
        assert code == 0 and told in summary and outputs["exit-code"] == "0", summary
        (tmp_path / "summary").unlink()


def test_expectations_are_handed_on(project: Path, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    text = '[[expected_failure]]\nengine = "biased"\nchannels = ["marker", "load:pivot.force"]\nstatus = "differ"\n'
    file.write_text(text + 'reason = "its gravity is a thousandth too large"\n', encoding="utf-8")
    case = str(project / "pendulum" / "single")
    code, summary, _ = act(project, tmp_path, cases=case, engines="biased", expect="mine.toml")
    assert code == 0 and "Failures that you expect" in summary, summary


def test_the_contract_of_nobody_is_refused_with_the_remedy(project: Path, tmp_path: Path) -> None:
    code, told, outputs = act(project, tmp_path, cases="canonical", contract="true")
    assert (code, outputs) == (2, {}) and "name your engines" in told
    assert not (tmp_path / "out").exists()


def test_a_session_that_did_not_begin_shows_nothing_of_an_earlier_one(project: Path, tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    for name in ("summary.md", "results.json"):
        (tmp_path / "out" / name).write_text("all was green", encoding="utf-8")
    code, told, outputs = act(project, tmp_path, cases="no/such", baseline="out/results.json")
    assert (code, outputs["exit-code"]) == (2, "2")
    assert "all was green" not in told and not (tmp_path / "summary").exists()
