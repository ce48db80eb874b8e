"""The pytest plug-in with a file of goals and failures of one's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from crosscheck.library.expect_file import NAME
from crosscheck.pytest_plugin import runs
from tests.crosscheck.fake_project import fake_project
from tests.crosscheck.pytest_plugin.test_plug_in import CHANNELS, on, properties_of, ran
from tests.crosscheck.sessions import run_here

pytest_plugins = ("pytester",)
FAILURE = """
[[expected_failure]]
engine = "biased"
channels = ["marker:tip.position", "load:pivot.force"]
status = "differ"
reason = "its gravity is a thousandth too large"
"""
GOAL = """
[[goal]]
engine = "stepper"
cases = ["single"]
goals = { load = 1e-3 }
reason = "its loads are rough"
"""


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fake_project(tmp_path_factory.mktemp("project")) / "pendulum" / "single"


@pytest.fixture
def inside(pytester: pytest.Pytester, case: Path, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    monkeypatch.syspath_prepend(str(case.parents[1]))
    monkeypatch.setattr(runs, "run_planned", run_here)
    return pytester


def test_an_expected_failure_is_one_with_its_reason(inside: pytest.Pytester, case: Path) -> None:
    Path(NAME).write_text(FAILURE, encoding="utf-8")
    result = ran(inside, *on(case, "biased"), "-rx")
    result.assert_outcomes(xfailed=2, passed=3)
    result.stdout.fnmatch_lines(["*differ, as you expect (*expected_failure[[]0]): its gravity is a*"])
    result.stdout.fnmatch_lines([f"crosscheck: 1 case on biased, expectations of {NAME}, records in *"])


def test_one_that_agrees_fails(inside: pytest.Pytester, case: Path) -> None:
    Path(NAME).write_text(FAILURE.replace('"load:pivot.force"', '"energy.total"'), encoding="utf-8")
    result = ran(inside, *on(case, "biased"))
    result.assert_outcomes(xfailed=1, failed=2 + 1, passed=5 - 4)  # the force fails; energy and its drift agree
    result.stdout.fnmatch_lines(["*energy.total: agree, expected differ:*you expect it to fail*"])


def test_what_passes_by_a_looser_goal_is_counted(inside: pytest.Pytester, case: Path) -> None:
    Path("mine.toml").write_text(GOAL, encoding="utf-8")
    result = ran(inside, *on(case, "stepper"), "--crosscheck-expect", "mine.toml", "--junitxml", "junit.xml")
    result.assert_outcomes(passed=len(CHANNELS))
    result.stdout.fnmatch_lines(["crosscheck: 2 passed by goals looser than the case's: stepper: its loads are rough"])
    found = properties_of(inside.path / "junit.xml", "pendulum/single[stepper-load:pivot.force]")
    assert (float(found["goal"]), float(found["case_goal"])) == (1e-3, 1e-6)


def test_a_file_that_is_wrong_is_a_usage_error(inside: pytest.Pytester, case: Path) -> None:
    Path(NAME).write_text(FAILURE.replace("differ", "crashed"), encoding="utf-8")
    result = ran(inside, *on(case, "biased"))
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: --crosscheck: {NAME}: *status*"])
