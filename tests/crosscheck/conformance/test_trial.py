"""Trying an engine in worker processes: what ends or hangs them breaks one clause, and the others are still tried."""

from __future__ import annotations

from typing import Any

import pytest

from crosscheck.conformance.trial import try_engine, verdict_on
from tests.crosscheck.engines.bad_engines import CRASHES, ENDLESS

BAD = "tests.crosscheck.conformance.test_trial:bad_engines"
FAKE = "tests.crosscheck.fake_engines:engines"
TWO = ("version-is-text", "a-run-is-what-was-asked-for")


def bad_engines() -> dict[str, Any]:
    """Engines that end or hang their process, as a worker asks for them."""
    return {name: (CRASHES | ENDLESS)[name].make() for name in ("segmentation_fault", "hangs")}


@pytest.mark.parametrize(
    "name, words", [("segmentation_fault", "exit code -11"), ("hangs", "stopped at its limit of 3 s")]
)
def test_what_ends_a_process_breaks_one_clause(name: str, words: str) -> None:
    first, second = try_engine(name, TWO, BAD, limit_s=3.0)
    assert (first.status, second.status) == ("holds", "broken")
    assert words in second.message


def test_an_engine_that_does_not_exist_is_missing() -> None:
    outcomes = list(try_engine("pinochio", TWO, FAKE))
    assert {each.status for each in outcomes} == {"missing"}
    assert 'there is no engine "pinochio"' in verdict_on(outcomes)[1]
