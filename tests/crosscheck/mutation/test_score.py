"""Scores: every ending of a mutant has an outcome, and what was not judged counts neither way."""

from __future__ import annotations

import math

import pytest

from crosscheck.judging.verdict import STATUSES, Status
from crosscheck.mutation.mutants import PassedOver
from crosscheck.mutation.score import Mutant, Outcome, ShownIn, mean, mutation_score, outcome


def shown(status: Status, E: float | None = 0.0, goal: float = 1e-6) -> ShownIn:
    return ShownIn(status=status, E=E, U=1e-9, goal=goal)


@pytest.mark.parametrize(
    ("statuses", "expected"),
    [
        (("differ", "agree"), "noticed"),
        (("differ", "did not run"), "noticed"),
        (("diverged", "diverged"), "noticed"),
        (("agree", "unresolved"), "missed"),
        (("unresolved",), "missed"),
        (("agree", "refused"), "missed"),
        (("refused",), "no mutant"),
        (("failed",), "no mutant"),
        (("did not finish",), "not judged"),
        (("agree", "crashed"), "not judged"),
        (("did not run",), "not judged"),
        ((), "not judged"),
    ],
)
def test_what_came_of_a_mutant(statuses: tuple[Status, ...], expected: Outcome) -> None:
    assert outcome({str(i): shown(status) for i, status in enumerate(statuses)})[0] == expected


@pytest.mark.parametrize("status", STATUSES)
def test_no_single_status_is_noticed_but_a_difference_or_a_divergence(status: Status) -> None:
    assert (outcome({"a": shown(status)})[0] == "noticed") == (status in ("differ", "diverged"))


def test_a_mutant_that_had_many_times_the_time_is_noticed() -> None:
    assert outcome({"a": shown("did not finish")}, patient=True) == ("noticed", True)
    assert outcome({"a": shown("crashed")}, patient=True)[0] == "not judged"


@pytest.mark.parametrize(
    ("E", "beyond"), [(2e-6, True), (1e-6, False), (1e-7, False), (math.inf, True), (math.nan, False), (None, False)]
)
def test_beyond_a_goal_is_more_than_it(E: float | None, beyond: bool) -> None:
    assert outcome({"a": shown("differ", E)}) == ("noticed", beyond)


def mutant(name: str, what: Outcome, **channels: Status) -> Mutant:
    return Mutant(
        mutation=name, target="", of="scene", outcome=what, beyond_goal=False, reason="",
        channels={key: shown(status) for key, status in channels.items()},
    )  # fmt: skip


def test_only_what_was_judged_counts() -> None:
    mutants = [
        mutant("one", "noticed", a="differ", b="agree"), mutant("two", "missed", a="agree", b="agree"),
        mutant("three", "not judged", a="crashed"), mutant("four", "no mutant", a="refused"),
    ]  # fmt: skip
    found = mutation_score("case", "variant", "engine", mutants, [PassedOver(mutation="five", target="", reason="why")])
    assert (found.score, found.score_at_goals) == (0.5, 0.0)
    assert {name: (each.noticed, each.mutants) for name, each in found.channels.items()} == {"a": (1, 2), "b": (0, 2)}
    assert [each.mutation for each in found.missed] == ["two"]
    assert [each.mutation for each in found.not_judged] == ["three"]


def test_a_case_without_mutants_has_no_score_and_is_no_part_of_the_mean() -> None:
    empty = mutation_score("case", "variant", "engine", [], [])
    one_of_two = [mutant("one", "noticed", a="differ"), mutant("two", "missed")]
    half = mutation_score("case", "variant", "engine", one_of_two, [])
    assert empty.score is None and empty.score_at_goals is None
    assert mean([empty.score, half.score]) == 0.5
    assert mean([None]) is None and mean([]) is None
