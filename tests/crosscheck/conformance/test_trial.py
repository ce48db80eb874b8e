"""Trying an engine in worker processes: what ends or hangs them breaks one clause, and the others are still tried."""

from __future__ import annotations

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
    assert {each.clause: (each.status, each.message) for each in outcomes} == dict.fromkeys(clauses, ("holds", ""))


@pytest.mark.parametrize("method", [FORKED, SPAWN])
def test_every_clause_has_a_process_of_its_own(method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "attempt", tell_process)
    monkeypatch.setattr(trial, "_start_method", lambda: method)
    told = [each.message for each in try_engine("fine", TWO, FAKE)]
    assert len(set(told)) == len(TWO)


def tell_process(trial: ClauseTrial, emit: Callable[[ClauseOutcome], None]) -> None:
    emit(ClauseOutcome(trial.clause, "", "holds", str(os.getpid())))


def test_an_engine_that_does_not_exist_is_missing() -> None:
    outcomes = list(try_engine("pinochio", TWO, FAKE))
    assert {each.status for each in outcomes} == {"missing"}
    assert 'there is no engine "pinochio"' in verdict_on(outcomes).text
