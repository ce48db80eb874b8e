"""Margins: a goal that is met by little or so that nothing can miss it is flagged, and no verdict changes."""

import json
from pathlib import Path

import msgspec
import pytest

from crosscheck.judging.margins import flag_of, margin
from crosscheck.report.ci import write_summary
from crosscheck.sealed.document import results_of
from tests.crosscheck.made_records import ONE_PAIR, TIP, judged, ladder, session_of, single, way


def runs(spread: float) -> list:
    """Two engines that agree; U is some 3 x 10 x `spread` each."""
    return [*ladder("one", {TIP: way()}, spread=spread), *ladder("two", {TIP: way()}, spread=spread)]


def test_a_margin_is_the_goal_over_what_was_reached() -> None:
    assert margin(1e-3, 1e-5, 1e-4) == pytest.approx(10.0)
    assert margin(1e-3, 1e-4, 1e-5) == pytest.approx(10.0)
    assert margin(1e-3, 0.0, 0.0) is margin(1e-3, None, None) is margin(0.0, 1.0, 1.0) is None


@pytest.mark.parametrize(
    ("size", "flag"), [(2.9, "narrow"), (3.0, None), (100.0, None), (1e4, None), (1.1e4, "wide"), (None, None)]
)
def test_flags_begin_where_they_say(size: float | None, flag: str | None) -> None:
    assert flag_of(size) == flag


@pytest.mark.parametrize(("spread", "flag"), [(1e-5, "narrow"), (1e-6, ""), (1e-11, "wide")])
def test_flags_are_in_every_output_and_change_no_verdict(spread: float, flag: str, tmp_path: Path) -> None:
    """The same goal: nearly missed, met as it should be (nothing is flagged), and met whatever happens."""
    outcome = judged(ONE_PAIR, runs(spread))
    assert outcome.ok
    assert single(outcome).status == "agree"
    assert [each.flag for each in outcome.flagged] == [flag] * bool(flag)
    write_summary(outcome, tmp_path / "summary.md")
    assert ("## Margins of goals" in (tmp_path / "summary.md").read_text(encoding="utf-8")) == bool(flag)
    sealed = results_of(session_of(ONE_PAIR, runs(spread)), outcome, tmp_path / "none")
    margins = json.loads(msgspec.json.encode(sealed))["cases"]["made/made"].get("margins", {})
    assert list(margins.get("both", {})) == [flag] * bool(flag)


def test_what_does_not_agree_has_no_margin() -> None:
    apart = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way(2.0)})]
    assert not judged(ONE_PAIR, apart).flagged
