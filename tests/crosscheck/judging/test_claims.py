"""What a user claims and expects of an engine: which verdicts it changes, and that none becomes green in silence."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.question import Question
from crosscheck.library.claims import ClaimedEfforts, ClaimedFailure, ClaimedGoals, Claims
from crosscheck.records.kinds import RunRecord
from crosscheck.report.ci import write_summary
from tests.crosscheck.made_records import ONE_PAIR, TIP, ended, judged, ladder, single, way

ROUGH = 1e-2  # U is a few times this part of the range: far above the goal of 1e-3
PLACE = "crosscheck-expect.toml: $.goal[0]"
CONSERVED = """
[[variant]]
name = "rigid"
engines = ["one"]

[[conservation]]
variant = "rigid"
quantity = "linear_momentum"
limit = 1e-3
"""


def runs(spread: float = ROUGH, apart: float = 0.0) -> list[RunRecord]:
    return [*ladder("one", {TIP: way(1.0 + apart)}), *ladder("two", {TIP: way()}, spread=spread)]


def goals(number: float, pattern: str = "*", engine: str = "two", **others: object) -> ClaimedGoals:
    return ClaimedGoals(engine=engine, place=PLACE, goals={pattern: number}, reason="of first order", **others)


def failure(status: str = "differ", channel: str = "*", engine: str = "two", **others: object) -> ClaimedFailure:
    return ClaimedFailure(engine=engine, place="f[0]", channels=(channel,), status=status, reason="issue 1", **others)


def session(records: list[RunRecord], text: str = ONE_PAIR, **claims: object) -> SessionOutcome:
    return judged(text, records, claims=Claims(**claims))


def test_a_looser_goal_is_enough_and_is_told_everywhere(tmp_path: Path) -> None:
    assert single(session(runs())).status == "unresolved"
    outcome = session(runs(), goals=(goals(0.5),))
    verdict = single(outcome)
    assert outcome.ok and verdict.loosened and (verdict.goal, verdict.case_goal) == (0.5, 1e-3)
    assert verdict.goal_reason == "two: of first order"
    assert outcome.headline == "All 1 verdicts are as expected, 1 of them by goals looser than the case's"
    write_summary(outcome, tmp_path / "summary.md")
    assert "goal 0.5 instead of 0.001: two: of first order" in (tmp_path / "summary.md").read_text(encoding="utf-8")


def test_no_goal_makes_results_agree_that_are_further_apart_than_their_uncertainty() -> None:
    assert single(session(runs(spread=1e-6, apart=0.01), goals=(goals(1.0),))).status == "differ"


@pytest.mark.parametrize("number", [math.nan, math.inf, -1.0, 0.0, 2.0])
def test_a_goal_that_is_none_agrees_with_nothing(number: float) -> None:
    """The file is checked before; a record may be damaged."""
    outcome = session(runs(), goals=(goals(number),))
    assert not outcome.ok and single(outcome).status == "unresolved"


def test_a_tighter_goal_is_judged_and_is_no_loosening() -> None:
    verdict = single(session(runs(), goals=(goals(1e-5),)))
    assert (verdict.status, verdict.goal, verdict.loosened) == ("unresolved", 1e-5, False)


def test_the_most_specific_pattern_counts_of_equal_ones_the_last_and_of_two_engines_the_larger() -> None:
    def goal(*given: ClaimedGoals) -> float:
        return single(session(runs(), goals=given)).goal

    assert goal(goals(0.1, TIP), goals(0.2, "marker"), goals(0.3)) == 0.1
    assert goal(goals(0.1), goals(0.2)) == 0.2
    assert goal(goals(0.1), goals(0.2, engine="one")) == goal(goals(0.2), goals(0.1, engine="one")) == 0.2
    assert goal(goals(0.1, "load")) == goal(goals(0.1, engine="three")) == 1e-3


def test_a_claimed_goal_is_the_limit_of_a_drift_too() -> None:
    momentum = np.ones((11, 3))
    momentum[5] = 0.99
    records = ladder("one", {"momentum.linear": momentum})
    assert single(judged(CONSERVED, records)).status == "differ"
    kept = session(records, CONSERVED, goals=(goals(0.05, "momentum", "one"),))
    assert kept.ok and single(kept).loosened
    assert not session(records, CONSERVED, goals=(goals(0.005, "momentum", "one"),)).ok


def test_controls_keep_the_goals_and_expectations_of_the_case() -> None:
    text = ONE_PAIR + """
[[control]]
name = "fault"
mutation = "mass"
target = "rod"
a = { variant = "rigid", engine = "one" }
b = { variant = "rigid", engine = "two" }
goals = { "marker:tip.position" = 1e-3 }
"""
    records = [*runs(1e-6), *ladder("one", {TIP: way(1.5)}, role="control:fault")[-1:]]
    outcome = session(records, text, goals=(goals(0.9),), failures=(failure(channel="load"),))
    (control,) = [verdict for verdict in outcome.all if verdict.kind == "control"]
    assert (control.goal, control.case_goal, control.expected, control.ok) == (1e-3, None, "differ", True)


def test_an_expected_failure_is_strict() -> None:
    wrong, right = runs(spread=1e-6, apart=0.01), runs(spread=1e-6)
    expected = session(wrong, failures=(failure(),))
    assert expected.ok and single(expected).own_failure == "f[0]"
    assert expected.headline.endswith(", 1 of them failures that you expect")
    mended = session(right, failures=(failure(),))
    assert not mended.ok and single(mended).status == "agree" and single(mended).expected == "differ"
    other = session(wrong, failures=(failure("unresolved"),))
    assert not other.ok
    assert session(wrong, failures=(failure("unresolved"), failure())).ok, "the last counts"


@pytest.mark.parametrize("status", ["crashed", "did not finish", "did not run"])
def test_what_died_is_never_an_expected_failure(status: str) -> None:
    records = [*ladder("one", {TIP: way()}), ended(ladder("two", {TIP: way()})[-1], status)]
    assert not session(records, failures=(failure("failed"), failure("differ"))).ok


@pytest.mark.parametrize("status", ["refused", "diverged", "failed"])
def test_an_ending_may_be_expected(status: str) -> None:
    records = [*ladder("one", {TIP: way()}), ended(ladder("two", {TIP: way()})[-1], status)]
    assert single(session(records, failures=(failure(status),))).ok
    assert not single(session(records)).ok


def test_what_the_case_itself_expects_stays() -> None:
    text = ONE_PAIR + 'expect = "differ"\nband = { "marker:tip.position" = [1e-3, 1e-1] }\nreason = "a bend"\n'
    verdict = single(session(runs(1e-6, 0.01), text, failures=(failure("unresolved"),)))
    assert verdict.ok and (verdict.expected, verdict.own_failure) == ("differ", "")


def test_a_pattern_that_names_nothing_is_an_error_if_all_its_cases_were_run() -> None:
    idle = session(runs(1e-6), goals=(goals(0.1, "wheel_load", whole=True),))
    assert not idle.ok and idle.idle_claims == (
        f'{PLACE}: "wheel_load" names no channel of two that is judged: correct it',
    )
    assert "1 of your own expectations name nothing" in idle.headline
    assert not session(runs(1e-6), failures=(failure(channel="load:elbow", whole=True),)).ok
    assert session(runs(1e-6), goals=(goals(0.1, "wheel_load"),)).ok, "another case may have it"
    assert session(runs(1e-6), goals=(goals(0.1, "marker", whole=True),)).ok
    lost = [*ladder("one", {TIP: way()}), ended(ladder("two", {TIP: way()})[-1], "diverged")]
    assert session(lost, goals=(goals(0.1, "load", whole=True),)).idle_claims == (), "what it would offer is not known"


def test_a_finer_effort_is_advised_that_will_do() -> None:
    """U of tolerances a decade apart falls by a decade for each effort more, until the goal is out of reach."""
    command = "add finer efforts: crosscheck run made/made --engine two --efforts two="
    verdict = single(session(runs(1e-3)))
    assert verdict.advice == command + "1e-09,1e-10" and verdict.U is not None and 1e-2 < verdict.U < 1e-1
    already = Claims(efforts=(ClaimedEfforts(engine="two", place="p", values=(1e-7, 1e-8)),))
    assert single(judged(ONE_PAIR, runs(1e-3), claims=already)).advice == command + "1e-07,1e-08,1e-09,1e-10"
    beyond = single(session(runs(1e-3), goals=(goals(1e-12),)))
    assert "claim what it reaches, such as --goal two=0." in beyond.advice
    nothing_resolved = single(session(runs(1e-1), goals=(goals(1e-12),)))
    assert nothing_resolved.advice == command + "1e-09,1e-10,1e-11"
    assert single(session(runs(1e-6))).advice == single(session(runs(1e-6, 0.01))).advice == ""


def test_a_broken_question_of_claims_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The planted fault: claims of the other engine are taken for its own."""
    monkeypatch.setattr(Question, "goal", lambda self, channel, goal: goal)
    assert single(session(runs(), goals=(goals(0.5),))).status == "unresolved"
