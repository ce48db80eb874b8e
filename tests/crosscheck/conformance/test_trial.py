"""Trying an engine in worker processes: what ends, hangs or spoils them breaks one clause, and no other."""

import os
import sys
from collections.abc import Callable
from typing import Any

import pytest

from crosscheck.conformance import trial
from crosscheck.conformance.trial import FORKED, ClauseOutcome, ClauseTrial, try_engine, verdict_on
from crosscheck.running.worker import SPAWN
from tests.crosscheck.engines.bad_engines import CRASHES, ENDLESS, Faulty, does

BAD = "tests.crosscheck.conformance.test_trial:bad_engines"
FAKE = "tests.crosscheck.fake_engines:engines"
TWO = ("version-is-text", "a-run-is-what-was-asked-for")
SHARED = ("quaternions-are-scalar-first", "a-hanging-mass-is-held-up", "branches-hang-on-their-parents")


def bad_engines() -> dict[str, Any]:
    """Engines that end, hang or spoil their process, as a worker asks for them; as plug-ins, none without a path."""
    if not sys.path:
        return {}
    bad = {name: (CRASHES | ENDLESS)[name].make() for name in ("segmentation_fault", "hangs")}
    return bad | {"clears_its_path": Faulty("clears_its_path", does(sys.path.clear), {})}


@pytest.mark.parametrize(
    "name, words", [("segmentation_fault", "exit code -11"), ("hangs", "stopped at its limit of 3 s")]
)
def test_what_ends_a_process_breaks_one_clause(name: str, words: str) -> None:
    first, second = try_engine(name, TWO, BAD, limit_s=3.0)
    assert (first.status, second.status) == ("holds", "broken")
    assert words in second.message


def test_what_an_engine_does_to_its_process_reaches_no_other_clause() -> None:
    """Without a path no module is found: in a process that serves several clauses there would be no engine."""
    clauses = ("a-run-is-what-was-asked-for", "a-solve-takes-time", "a-refusal-has-a-reason", "version-is-text")
    outcomes = list(try_engine("clears_its_path", clauses, BAD))
    assert {outcome.clause: (outcome.status, outcome.message) for outcome in outcomes} == dict.fromkeys(
        clauses, ("holds", "")
    )


@pytest.mark.parametrize("method", [FORKED, SPAWN])
def test_every_clause_of_form_has_a_process_of_its_own(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "attempt", tell_process)
    monkeypatch.setattr(trial, "_start_method", lambda: method)
    told = [each.message for each in try_engine("fine", TWO, FAKE)]
    assert len(set(told)) == len(TWO)


def test_clauses_on_mechanics_share_a_process_and_are_told_in_their_order(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "attempt", tell_process)
    heard: list[tuple[int, str]] = []
    asked = (SHARED[0], *TWO, *SHARED[1:])
    told = list(try_engine("fine", asked, FAKE, workers=2, listener=lambda *each: heard.append(each)))
    assert [each.clause for each in told] == list(asked) == list(dict.fromkeys(each.clause for each in told))
    processes = {each.clause: each.message for each in told}
    assert len({processes[name] for name in SHARED}) <= 2 and len({processes[name] for name in TWO}) == 2
    assert sorted(name for _, name in heard) == sorted(asked)


def test_what_is_broken_in_a_shared_process_is_tried_again_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first clause spoils the process for those that follow; alone each of them holds."""
    monkeypatch.setattr(trial, "attempt", spoil)
    found = {each.clause: each.status for each in try_engine("fine", SHARED, FAKE)}
    assert found == {SHARED[0]: "broken", SHARED[1]: "holds", SHARED[2]: "holds"}


def spoil(trial: ClauseTrial, emit: Callable[[ClauseOutcome], None]) -> None:
    spoilt = "SPOILT" in os.environ or trial.clause == SHARED[0]
    os.environ["SPOILT"] = "1"
    emit(ClauseOutcome(trial.clause, "", "broken" if spoilt else "holds"))


def test_clauses_that_were_chosen_are_not_the_contract() -> None:
    holding = [ClauseOutcome(name, "", "holds") for name in SHARED]
    assert verdict_on(holding).kept is False and verdict_on(holding, chosen=True).kept is True
    assert verdict_on(holding, chosen=True).whole is False
    none = [ClauseOutcome(name, "", "not offered", offer="move") for name in SHARED]
    assert verdict_on(none, chosen=True).kept is False, "nothing was shown"


def tell_process(trial: ClauseTrial, emit: Callable[[ClauseOutcome], None]) -> None:
    emit(ClauseOutcome(trial.clause, "", "holds", str(os.getpid())))


def test_an_engine_that_does_not_exist_is_missing() -> None:
    outcomes = list(try_engine("pinochio", TWO, FAKE))
    assert {outcome.status for outcome in outcomes} == {"missing"}
    assert 'there is no engine "pinochio"' in verdict_on(outcomes).text
