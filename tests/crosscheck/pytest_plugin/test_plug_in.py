"""The pytest plug-in, as another project's continuous integration uses it, also with goals and failures of its own."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest

from crosscheck.conformance import trial
from crosscheck.engines.registry import engine
from crosscheck.library import own_files
from crosscheck.library.expect_file import NAME
from crosscheck.pytest_plugin import compared, items, request, runs
from tests.crosscheck.fake_project import fake_project
from tests.crosscheck.sessions import copy_case, run_here
from tests.repo.project import ROOT

pytest_plugins = ("pytester",)
LOADED = (compared, items, request, runs)  # before pytest runs inside pytest, which forgets what it imports meanwhile
CHANNELS = ["marker:tip.position", "load:pivot.torque", "load:pivot.force", "energy.total", "energy.total conserved"]


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the small case, its stored reference, and a distribution of plug-ins: the fake engines."""
    return fake_project(tmp_path_factory.mktemp("project"))


@pytest.fixture
def case(project: Path) -> Path:
    return project / "pendulum" / "single"


@pytest.fixture
def inside(pytester: pytest.Pytester, project: Path, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    """A session in this process, whose engines run in it too."""
    monkeypatch.syspath_prepend(str(project))
    monkeypatch.setattr(runs, "run_planned", run_here)
    return pytester


def ran(session: pytest.Pytester, *words: str) -> pytest.RunResult:
    quiet = ("-p", "no:cacheprovider", "-W", "ignore::pytest.PytestAssertRewriteWarning")
    return session.runpytest_inprocess("-p", "crosscheck.pytest_plugin", *quiet, *map(str, words))


def on(case: Path, *engines: str) -> list[str]:
    return ["--crosscheck", str(case), *(word for name in engines for word in ("--crosscheck-engine", name))]


def test_a_sound_engine_passes_every_channel(inside: pytest.Pytester, case: Path) -> None:
    result = ran(inside, *on(case, "stepper"), "-v")
    result.assert_outcomes(passed=len(CHANNELS))
    for channel in CHANNELS:
        result.stdout.fnmatch_lines([f"*crosscheck::pendulum/single[[]stepper-{channel}] PASSED*"])
    result.stdout.fnmatch_lines(["crosscheck: 1 case on stepper, records in *"])


def test_a_wrong_engine_fails_with_figures(inside: pytest.Pytester, case: Path) -> None:
    result = ran(inside, *on(case, "biased"))
    result.assert_outcomes(failed=2, passed=3)  # the torque is zero as it should be, and so is the sum of its energy
    result.stdout.fnmatch_lines(["pendulum/single, biased on rigid, marker:tip.position: differ, expected agree: *"])
    assert result.ret == pytest.ExitCode.TESTS_FAILED


def properties_of(junit: Path, name: str) -> dict[str, str]:
    """What junit.xml says of one item."""
    (test,) = (each for each in ElementTree.parse(junit).getroot().iter("testcase") if each.get("name") == name)
    return {str(each.get("name")): str(each.get("value")) for each in test.iter("property")}


def test_figures_are_properties_in_junit(inside: pytest.Pytester, case: Path) -> None:
    ran(inside, *on(case, "fine"), "--junitxml", "junit.xml")
    found = properties_of(inside.path / "junit.xml", "pendulum/single[fine-marker:tip.position]")
    assert (found["engine"], found["channel"], found["status"]) == ("fine", CHANNELS[0], "agree")
    assert 0.0 <= float(found["E"]) <= float(found["U"]) <= float(found["goal"]) == 1e-6
    assert len(found["reference"]) == 64


def test_a_missing_engine_is_an_error(inside: pytest.Pytester, case: Path) -> None:
    result = ran(inside, *on(case, "absent", "fine"))
    result.assert_outcomes(errors=len(CHANNELS), passed=len(CHANNELS))
    result.stdout.fnmatch_lines(["*install the extra `absent`*"])


def test_a_missing_engine_may_be_allowed(inside: pytest.Pytester, case: Path) -> None:
    for name in ("absent", "nowhere"):
        result = ran(inside, *on(case, name), "--crosscheck-allow-missing")
        result.assert_outcomes(skipped=len(CHANNELS))
        assert result.ret == pytest.ExitCode.OK


def test_an_engine_that_refuses_everything_is_not_green(inside: pytest.Pytester, case: Path) -> None:
    result = ran(inside, *on(case, "refuser"), "-rs")
    result.assert_outcomes(skipped=len(CHANNELS))
    result.stdout.fnmatch_lines(["*refuser refuses: *revolute hinges are beyond it*"])
    result.stdout.fnmatch_lines(["crosscheck: refuser was compared in nothing: all its items were skipped"])
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    ran(inside, *on(case, "refuser"), "--crosscheck-strict").assert_outcomes(failed=len(CHANNELS))


@pytest.mark.parametrize("name, words", [("raiser", "the solver gave up on purpose"), ("diverger", "diverged at t = ")])
def test_an_engine_without_a_result_fails(inside: pytest.Pytester, case: Path, name: str, words: str) -> None:
    result = ran(inside, *on(case, name))
    result.assert_outcomes(failed=len(CHANNELS))
    result.stdout.fnmatch_lines([f"*{words}*"])


def copied(case: Path, folder: Path) -> Path:
    """The case with its reference, in a folder where it may be changed."""
    return Path(shutil.copytree(case, folder / "pendulum" / "single"))


def test_what_the_case_expects_is_an_expected_failure(inside: pytest.Pytester, case: Path, tmp_path: Path) -> None:
    name = "pendulum/single[stepper-energy.total conserved]"
    ran(inside, *on(case, "stepper"), "--junitxml", "junit.xml")
    drift = float(properties_of(inside.path / "junit.xml", name)["E"])
    folder = copied(case, tmp_path)
    file = folder / "run.toml"
    bounds = f'limit = {drift / 10}\nexpect = "differ"\nband = [{drift / 2}, {drift * 2}]\nreason = "long steps"'
    file.write_text(file.read_text(encoding="utf-8").replace("limit = 1e-8", bounds), encoding="utf-8")
    result = ran(inside, *on(folder, "stepper"), "-rx")
    result.assert_outcomes(passed=len(CHANNELS) - 1, xfailed=1)
    result.stdout.fnmatch_lines(["*differ, as the case expects: long steps*"])


def test_a_case_without_a_reference_fails(inside: pytest.Pytester, tmp_path: Path) -> None:
    result = ran(inside, *on(copy_case(tmp_path), "fine"))
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["pendulum/single: the case has no stored reference"])


def test_a_reference_that_was_changed_fails(inside: pytest.Pytester, case: Path, tmp_path: Path) -> None:
    folder = copied(case, tmp_path)
    values = folder / "reference.csv"
    values.write_text(values.read_text(encoding="utf-8").replace("1", "2", 1), encoding="utf-8")
    result = ran(inside, *on(folder, "fine"))
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*was changed after reference.toml was written*"])


def test_tags_are_marks(inside: pytest.Pytester, case: Path) -> None:
    """One called `skip` is none: pytest would obey it."""
    inside.makepyfile("def test_of_the_project(): pass")
    every = ran(inside, *on(case, "fine"), "--strict-markers")
    every.assert_outcomes(passed=1 + len(CHANNELS))
    ran(inside, *on(case, "fine"), "-m", "small and crosscheck").assert_outcomes(passed=len(CHANNELS), deselected=1)
    chosen = ran(inside, *on(case, "fine"), "-k", "position")
    chosen.assert_outcomes(passed=1, deselected=len(CHANNELS))


def test_cases_that_lie_in_no_folder_are_a_usage_error(
    inside: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where crosscheck was imported from a zip file: a sentence, before anything runs."""
    monkeypatch.setattr(own_files, "find_spec", lambda name: None)
    result = ran(inside, "--crosscheck", "wheel_*", "--crosscheck-engine", "fine")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines(["*crosscheck reads the source files of crosscheck, and *"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--crosscheck", "wheel_*/nothing"], "needs --crosscheck-engine NAME"),
        (["--crosscheck", "wheel_*/nothing", "--crosscheck-engine", "fine"], '"wheel_[*]/nothing" is a pattern'),
        (["--crosscheck", "four_baer", "--crosscheck-engine", "fine"], 'did you mean "four_bar"'),
        (["--crosscheck", "all", "--crosscheck-engine", "fihne"], 'no engine "fihne": did you mean "fine"'),
        (["--crosscheck-engine", "fine"], "needs --crosscheck CASES, or --crosscheck-contract"),
    ],
)
def test_what_makes_no_sense_is_a_usage_error(inside: pytest.Pytester, words: list[str], message: str) -> None:
    result = ran(inside, *words)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"ERROR: *{message}*"])


def test_without_its_options_it_does_nothing(inside: pytest.Pytester) -> None:
    inside.makepyfile("def test_of_the_project(): pass")
    result = ran(inside)
    result.assert_outcomes(passed=1)
    result.stdout.no_fnmatch_line("*crosscheck*")


def test_records_are_kept_where_that_is_asked_for(inside: pytest.Pytester, case: Path) -> None:
    ran(inside, *on(case, "fine"), "--crosscheck-out", "kept")
    assert (inside.path / "kept" / "pendulum" / "single" / "fine" / "records.jsonl").exists()


def test_under_xdist_an_engine_runs_once(pytester: pytest.Pytester, project: Path, case: Path) -> None:
    """Two processes want channels of one case at once: one of them has the engine run, in a worker of its own."""
    diary = pytester.path / "diary"
    path = os.pathsep.join([str(project), str(ROOT)])
    pytester._monkeypatch.setenv("PYTHONPATH", path)
    pytester._monkeypatch.setenv("FAKE_ENGINE_DIARY", str(diary))
    words = ("-p", "crosscheck.pytest_plugin", *on(case, "diarist"), "-n", "2")
    result = pytester.runpytest_subprocess(*words, timeout=120)
    result.assert_outcomes(passed=len(CHANNELS))
    written = diary.read_text(encoding="utf-8").splitlines()
    repeats, beginning = 3, 1  # of runs as short as these are on an idle machine, and of the coarsest
    assert len(set(written)) <= len(written) <= repeats * len(set(written)) + beginning


def tried_here(name: str, provider: str) -> Iterator[trial.ClauseOutcome]:
    """What `try_engine` yields, without its worker processes."""
    return (trial.try_clause(engine(name), clause) for clause in items.CLAUSES.values())


def test_the_contract_is_tried_too(inside: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runs, "try_engine", tried_here)
    result = ran(inside, "--crosscheck-contract", "--crosscheck-engine", "refuser", "-rs", "-v")
    result.stdout.fnmatch_lines(["*crosscheck::contract[[]refuser-version-is-text] PASSED*"])
    result.stdout.fnmatch_lines(["*revolute hinges are beyond it*"])
    wrong = ran(inside, "--crosscheck-contract", "--crosscheck-engine", "fine", "-k", "hanging-mass or version")
    wrong.assert_outcomes(passed=1, failed=1, deselected=len(items.CLAUSES) - 2)
    wrong.stdout.fnmatch_lines(["*the contract says: `loads[[]hinge]` acts on the outboard body*"])


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
