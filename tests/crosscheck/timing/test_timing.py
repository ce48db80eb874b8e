"""Benchmarks and charts: who is timed as an equal, what a crash costs, the front, the files."""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from math import inf, nan
from pathlib import Path

import pytest
from typer.testing import CliRunner

from crosscheck import cli
from crosscheck.engines.contract import Effort
from crosscheck.judging.work import seconds
from crosscheck.library.case import CaseError
from crosscheck.library.find import Case, load_case, resolve
from crosscheck.running.job import Job
from crosscheck.running.plan import plan
from crosscheck.running.scheduler import Limits
from crosscheck.timing import turns
from crosscheck.timing.bench import CaseBench, Contest, bench
from crosscheck.timing.benchmark_json import benchmark_document
from crosscheck.timing.chart import CaseCharts, ChartPoint, chart, with_front
from crosscheck.timing.page import folder_name, write_case, write_index
from crosscheck.timing.rivals import UNSAID, facts_of, find_rivals
from crosscheck.timing.turns import CompileTimes, FirstSolve, Sample, Timed, Turn, TurnFailure, in_turns, take_turn
from tests.crosscheck.sessions import referenced, run_here

PROVIDER = "tests.crosscheck.timing.racing_engines:engines"
SHIPPED = "crosscheck.engines.registry:engines"
LIMITS = Limits(1, 60.0)
CASE = """
[[variant]]
name = "rigid"
engines = ["fine", "frank", "stepper"]
also = ["biased", "refuser", "absent", "raiser", "diverger", "not a number"]

[[comparison]]
name = "all"
variant = "rigid"
engines = ["fine", "frank", "stepper"]
goals = { "marker:tip.position" = 1e-5, "energy" = 1e-5 }

[[chart]]
observable = "marker:tip.position"
variants = ["rigid"]
reference = "rigid"

[reference]
variant = "rigid"
samples = 11

[[reference.route]]
engine = "fine"

[[reference.route]]
engine = "stepper"
"""


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Case]:
    """The small case with a reference; trials run in this process, turns in workers where nothing else is said."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("crosscheck.timing.rivals.run_planned", run_here)
        yield load_case(referenced(tmp_path_factory.mktemp("timing"), CASE))


@pytest.fixture
def turns_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Turns in this process, where no engine may crash."""

    def ask(self: object, each: Timed, turn: Turn) -> object:
        answers: list[object] = []
        take_turn(turn, answers.append)
        if isinstance(answers[0], TurnFailure):
            each.failure = answers[0].message
        return answers[0]

    monkeypatch.setattr(turns._Asker, "__call__", ask)


def race(case: Case, *engines: str, accuracy: float = 1e-4, rounds: int = 2) -> CaseBench:
    return bench(case, engines, (), rounds=rounds, accuracy=accuracy, provider=PROVIDER, limits=LIMITS)


def by_engine(found: CaseBench) -> dict[str, Contest]:
    return {contest.rival.job.engine: contest for contest in found.contests}


def job(case: Case, engine: str) -> Job:
    _, jobs = plan(case, (), PROVIDER)
    return replace(jobs[0], engine=engine, time_limit_s=60.0)


def test_only_who_agrees_and_is_accurate_is_an_equal(case: Case, turns_here: None) -> None:
    found = by_engine(race(case, accuracy=1e-5))
    standings = {name: each.standing for name, each in found.items()}
    assert {name for name, standing in standings.items() if standing == "equal"} == {"fine", "frank", "stepper"}
    assert all(standings[name] == "not timed" for name in ("biased", "refuser", "absent", "raiser", "diverger"))
    assert "disagrees with the reference" in found["biased"].why
    assert "beyond it" in found["refuser"].why
    assert "extra `absent`" in found["absent"].why
    assert "gave up on purpose" in found["raiser"].why
    assert "not finite" in found["not a number"].why
    assert all((each.timed is None) == (each.standing == "not timed") for each in found.values())
    assert found["fine"].timed is not None and len(found["fine"].timed.samples) >= 2


def test_the_cheapest_effort_within_the_accuracy_is_timed(case: Case, turns_here: None) -> None:
    rival = by_engine(race(case, "stepper"))["stepper"].rival
    coarse, *_, finest = rival.rungs
    assert coarse.error > finest.error > 0.0
    for accuracy, standing, effort in (
        (2.0 * coarse.error, "equal", coarse.effort),
        (finest.error, "equal", finest.effort),
        (0.5 * finest.error, "apart", finest.effort),
    ):
        found = by_engine(race(case, "stepper", accuracy=accuracy))["stepper"]
        assert found.rung is not None
        assert (found.standing, found.rung.effort) == (standing, effort)
    assert "not within" in found.why


def test_a_case_without_a_reference_is_told(case: Case, tmp_path: Path) -> None:
    folder = tmp_path / "bare"
    shutil.copytree(case.folder, folder)
    (folder / "reference.csv").unlink()
    (folder / "reference.toml").unlink()
    found = race(load_case(folder))
    assert found.contests == ()
    assert "crosscheck regenerate" in found.problem
    with pytest.raises(CaseError, match="no stored reference"):
        find_rivals(load_case(folder), provider=PROVIDER, limits=LIMITS)


def test_a_reference_that_was_changed_is_not_used(case: Case, tmp_path: Path) -> None:
    folder = tmp_path / "changed"
    shutil.copytree(case.folder, folder)
    with (folder / "reference.csv").open("a", encoding="utf-8") as values:
        values.write("\n")
    assert "cannot be used" in race(load_case(folder)).problem


def test_a_crash_in_its_turn_costs_only_its_own(case: Case) -> None:
    """Processes of their own: one dies, one has no clock, one stops solving; the sound one has all its samples."""
    effort = Effort("tolerance", 1e-6, "DOP853")
    names = ("fickle", "fine", "clockless", "forgetful")
    entries = [(job(case, name), effort) for name in names]
    timed = dict(zip(names, in_turns(entries, 2), strict=True))
    assert "exit code" in timed["fickle"].failure
    assert "no time that can be compared" in timed["clockless"].failure
    assert "it forgot how" in timed["forgetful"].failure
    assert not any(timed[name].samples for name in names if name != "fine")
    assert not timed["fine"].failure
    assert timed["fine"].first is not None
    assert len(timed["fine"].samples) == 2 * timed["fine"].first.solves


def test_efforts_of_one_rival_share_what_is_compiled(case: Case, turns_here: None) -> None:
    fine = job(case, "fine")
    coarse, finer = in_turns([(fine, Effort("tolerance", value, "DOP853")) for value in (1e-4, 1e-6)], 1)
    assert coarse.prepared is finer.prepared is not None
    assert coarse.samples and finer.samples


def test_the_document_is_read_by_pytest_benchmark(case: Case, turns_here: None, tmp_path: Path) -> None:
    found = race(case, "fine", "frank", "biased")
    file = tmp_path / "bench.json"
    document = benchmark_document([found, CaseBench("other", 1e-4, 2, problem="it has no reference")])
    file.write_text(json.dumps(document, allow_nan=False), encoding="utf-8")
    (frank,) = [each for each in document["benchmarks"] if each["params"]["engine"] == "frank"]
    assert frank["params"] == {
        "variant": "rigid", "engine": "frank", "level": "rigid", "algorithm": "one angle", "integrator": "dop853",
    }  # fmt: skip
    assert frank["extra_info"]["standing"] == "equal"
    assert {each["name"] for each in document["not_timed"]} == {"", "rigid · biased"}
    command = [sys.executable, "-m", "pytest_benchmark", "compare", str(file), "--columns=min,iqr"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "rigid · frank" in done.stdout + done.stderr


def point(solve_s: float | None, error: float | None) -> ChartPoint:
    return ChartPoint("rigid", "fine", "DOP853", f"rtol={error}", solve_s, None, error)


@pytest.mark.parametrize(
    ("points", "floor", "best"),
    [
        ([(1.0, 1e-3), (2.0, 1e-6), (3.0, 1e-5)], 1e-9, [True, True, False]),
        ([(1.0, 1e-10), (2.0, 1e-12)], 1e-9, [True, False]),  # nothing can be told below the floor
        ([(1.0, 1e-3), (1.0, 1e-4)], 0.0, [False, True]),
        ([(1.0, 1e-3), (None, None)], 0.0, [True, False]),
        ([(1.0, 0.0)], 0.0, [True]),
        ([(1.0, 1e-3)], inf, [False]),  # a reference of which nothing is known
        ([], 0.0, []),
    ],
)
def test_the_front(points: list[tuple[float | None, float | None]], floor: float, best: list[bool]) -> None:
    assert [each.best for each in with_front([point(*each) for each in points], floor)] == best


def test_a_chart_has_errors_floor_failures_and_settings(case: Case, turns_here: None, tmp_path: Path) -> None:
    found = drawn(case)
    (data,) = found.charts
    assert data.observable == "marker:tip.position"
    assert 0.0 < data.floor < 1e-5
    fine = [point for point in data.points if point.engine == "fine"]
    assert len(fine) >= 3
    assert [each.error for each in fine] == sorted((each.error for each in fine), reverse=True)
    assert all(point.error is None and point.message for point in data.points if point.engine in ("refuser", "absent"))
    assert any(point.best for point in data.points)
    page = write_case(found, tmp_path)
    text = page.read_text(encoding="utf-8")
    assert "SciPy&#39;s DOP853, nothing else." in text
    assert UNSAID in text
    assert "revolute hinges are beyond it" in text
    assert "crosscheck run" in text
    picture = (page.parent / "marker_tip.position.svg").read_text(encoding="utf-8")
    assert all(what in picture for what in ("fine, dop853", "Pareto front", "uncertainty of the reference", "refuser"))
    stored = json.loads((page.parent / "charts.json").read_text(encoding="utf-8"))
    assert stored["charts"]["charts"][0]["points"][0]["engine"] == "fine"
    index = write_index([found, CaseCharts("other", "", "", 0.0, 1, problem="<no reference>")], tmp_path)
    assert "&lt;no reference&gt;" in index.read_text(encoding="utf-8")


def drawn(case: Case, *engines: str) -> CaseCharts:
    return chart(case, engines, (), rounds=1, provider=PROVIDER, limits=LIMITS)


def test_a_chart_of_failures_alone_is_a_problem_that_says_so(case: Case, turns_here: None) -> None:
    found = drawn(case, "refuser")
    assert found.charts == ()
    assert "nothing to draw" in found.problem
    assert "beyond it" in found.problem


def test_one_effort_is_drawn(case: Case, turns_here: None, tmp_path: Path) -> None:
    found = drawn(case, "fine")
    only = replace(found.charts[0], points=found.charts[0].points[:1])
    write_case(replace(found, charts=(only,)), tmp_path)
    nothing = replace(only, points=(point(None, None),), floor=nan)
    write_case(replace(found, charts=(nothing,)), tmp_path)


def test_engines_say_how_they_are_run() -> None:
    found = facts_of(("native", "native-frisch", "pinocchio", "mujoco", "exudyn"), SHIPPED)
    assert all(each.algorithm and each.settings not in ("", UNSAID) for each in found.values())
    assert "Contacts are off" in found["mujoco"].settings
    assert facts_of(("nobody",), PROVIDER)["nobody"].settings.startswith('there is no engine "nobody"')


def test_what_a_turn_emits(case: Case) -> None:
    answers: list[object] = []
    effort = Effort("tolerance", 1e-6, "DOP853")
    fine = job(case, "fine")
    for turn in (Turn(fine), Turn(fine, effort), Turn(fine, effort, 3), Turn(replace(fine, scene=None, error="why"))):
        take_turn(turn, answers.append)
    prepared, first, samples, failure = answers
    assert isinstance(prepared, CompileTimes) and prepared.again_s > 0.0
    assert isinstance(first, FirstSolve) and "marker:tip.position" in first.channels
    assert isinstance(samples, list) and len(samples) == 3
    assert all(isinstance(sample, Sample) and sample.call_s > 0.0 for sample in samples)
    assert isinstance(failure, TurnFailure) and "why" in failure.message


def test_names_and_times() -> None:
    assert folder_name("tops/gyrostat") == "tops_gyrostat"
    assert folder_name("../..") == "_" or "." not in folder_name("../..")[:1]
    assert [seconds(value) for value in (2.0, 0.0123, 4.56e-5)] == ["2 s", "12.3 ms", "45.6 us"]


@pytest.mark.parametrize(
    "words", [("--accuracy", "nan"), ("--accuracy", "0"), ("--rounds", "0"), ("--time-limit", "0")], ids=" ".join
)
def test_requests_that_make_no_sense_are_refused_before_anything_runs(words: tuple[str, ...]) -> None:
    assert CliRunner().invoke(cli.app, ["bench", "pendulums/compound", *words]).exit_code == 2


def test_a_shipped_case_is_timed(tmp_path: Path) -> None:
    """Real engines in real workers, through the command line."""
    (shipped,) = resolve(("pendulums/compound",))
    file = tmp_path / "bench.json"
    words = ["bench", str(shipped.folder), "-e", "mujoco", "--rounds", "2", "--json", str(file)]
    result = CliRunner().invoke(cli.app, words)
    assert result.exit_code == 0, result.output
    (only,) = json.loads(file.read_text(encoding="utf-8"))["benchmarks"]
    assert 0.0 < only["stats"]["min"] <= only["stats"]["q1"]
    assert only["extra_info"]["first_compile_s"] > 0.0
