"""What runs take, beside how accurate they are: counts are held against those of the stored reference."""

import json
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.native import NativeEngine
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.library.work import Counts, RunWork, changes, key
from crosscheck.records.kinds import RecordedReference, ReferenceGoals, RunRecord
from crosscheck.records.packing import pack
from crosscheck.report.ci import write_summary
from crosscheck.sealed.document import results_of
from flexmb.run.operations import of_evaluation
from flexmb.system.compile import compile
from tests.crosscheck.made_records import ONE_PAIR, TIMES, TIP, judged, ladder, session_of, way
from tests.trees import RIGID, random_scene

THEN = Counts(evaluations=300, steps=30)


def session(
    *, strict: bool = False, times: np.ndarray = TIMES, made_with: tuple[str, ...] = ("one 1",), **now: int
) -> SessionOutcome:
    """Two engines whose finest runs made 300 evaluations in 30 steps, but for the changes `now` of the first, held
    against a reference that engine one made."""
    runs = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way()})]
    runs = [msgspec.structs.replace(run, steps=run.evaluations // 10) for run in runs]
    runs[2] = msgspec.structs.replace(runs[2], wall_s=0.5, cpu_s=0.75, **now)
    reference = RecordedReference(
        variant="rigid", asked={"one": ReferenceGoals(goals={TIP: 1e-3})}, times=pack(times),
        channels={TIP: pack(way()[: len(times)])}, uncertainties={TIP: 1e-5}, made_with=made_with,
        work={key("one", "rigid", runs[2].effort): THEN},
    )  # fmt: skip
    return judged(ONE_PAIR, runs, strict=strict, reference=reference)


@pytest.mark.parametrize(
    ("now", "told"),
    [
        ({"evaluations": 330}, []),
        ({"evaluations": 331}, ["more work than recorded: 331 evaluations, 300 for the reference"]),
        ({"steps": 34}, ["more work than recorded: 34 steps, 30 for the reference"]),
        ({"steps": 0}, []),  # not counted any more: nothing that could be compared
    ],
)
def test_more_work_is_a_warning_and_strictly_an_error(now: dict[str, int], told: list[str]) -> None:
    usual, strict = session(**now), session(strict=True, **now)
    assert [str(change).partition(": ")[2] for change in usual.work_changes] == told
    assert usual.ok
    assert strict.ok == (not told)
    assert bool(told) == ("more work than recorded" in strict.headline)


def test_less_work_and_another_version_are_told_and_never_an_error() -> None:
    less = session(strict=True, evaluations=200)
    assert [change.dearer for change in less.work_changes] == [False]
    assert less.ok
    other = session(strict=True, evaluations=900, made_with=("one 0",))
    assert [change.version for change in other.work_changes] == ["one 0"]
    assert other.ok
    assert not session(strict=True, evaluations=900).ok  # by the same version it is


def test_runs_at_other_times_are_not_compared() -> None:
    assert session(evaluations=900).work_changes
    assert not session(evaluations=900, times=TIMES[::2]).work_changes


def test_every_verdict_knows_the_work_of_its_runs() -> None:
    outcome = session(operations=7)
    pair = next(verdict for verdict in outcome.all if verdict.comparison == "both")
    one, two = outcome.work_of(pair)
    assert one == RunWork(effort="rtol=2", wall_s=0.5, cpu_s=0.75, evaluations=300, steps=30, operations=7)
    assert two is not None
    assert two.uncounted == ("operations",)
    assert two.words("two").endswith("operations not counted by two")
    against = next(verdict for verdict in outcome.all if verdict.engine_b == "reference")
    assert outcome.work_of(against) == (one, None)


def test_what_is_not_counted_is_named_in_every_output(tmp_path: Path) -> None:
    runs: list[RunRecord] = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way()})]
    outcome = judged(ONE_PAIR, runs)
    write_summary(outcome, tmp_path / "summary.md")
    assert "steps, operations not counted by two" in (tmp_path / "summary.md").read_text(encoding="utf-8")
    sealed = results_of(session_of(ONE_PAIR, runs), outcome, tmp_path / "none")
    run = json.loads(msgspec.json.encode(sealed))["cases"]["made/made"]["runs"]["rigid | two | main"]
    assert run["uncounted"] == ["steps", "operations"]
    assert run["evaluations"] == 300


def test_a_tenth_is_alike_in_both_directions() -> None:
    assert not list(changes(Counts(100), Counts(110))) + list(changes(Counts(100), Counts(90)))
    assert list(changes(Counts(100), Counts(89))) == [("evaluations", 100, 89)]


def test_native_counts_steps_and_operations() -> None:
    """An explicit method executes the operations of one evaluation as often as it evaluates."""
    scene = random_scene(3, RIGID)
    model = NativeEngine().compile(scene)
    run = model.simulate(Run(np.linspace(0.0, 0.1, 3)), Effort("step", 0.01, "rk4"))
    assert run.steps == 10
    assert run.operations == run.evaluations * of_evaluation(compile(scene), "articulated")
