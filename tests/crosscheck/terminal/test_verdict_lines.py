"""What the terminal says of accepted figures: one line for all that is stale, and one for what is worse."""

from __future__ import annotations

import io

import msgspec
import pytest
from rich.console import Console

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import Verdict
from crosscheck.terminal.text import Verbosity
from crosscheck.terminal.verdicts import print_outcome

GOOD = Verdict(
    case="family/one", comparison="both", kind="comparison", channel="energy.total", variant_a="rigid",
    engine_a="native", variant_b="rigid", engine_b="pinocchio", level="rigid", status="agree", expected="agree",
    E=1e-9, U=1e-8, goal=1e-6, scale=1.0, reason="within U",
)  # fmt: skip


def shown(*verdicts: Verdict, made_with: str = "flexmb 1.2, AMD", verbosity: Verbosity = Verbosity.NORMAL) -> str:
    screen = io.StringIO()
    cases = {each.case: [one for one in verdicts if one.case == each.case] for each in verdicts}
    outcome = SessionOutcome(verdicts=cases, absences=[], made_with=made_with)
    print_outcome(Console(file=screen, width=80), outcome, verbosity)
    return screen.getvalue()


def test_stale_figures_take_one_line_with_their_reasons_and_one_command() -> None:
    stale = [msgspec.structs.replace(GOOD, case=f"family/{name}", stale="other efforts") for name in ("one", "a b")]
    said = shown(*stale, stale[0], msgspec.structs.replace(GOOD, stale="another scene, times or scale"))
    assert said.count("stale") == 1
    assert "4 accepted figures of 2 cases are stale (other efforts: 3; another scene, times or scale: 1)" in said
    assert "crosscheck run family/one 'family/a b' --accept" in said
    assert "1 accepted figure is stale (other efforts)" in shown(stale[0])
    assert "stale" not in shown(GOOD)


def test_what_is_worse_says_what_differs_and_what_to_do() -> None:
    worse = msgspec.structs.replace(GOOD, worse="U is 1e-05, accepted were 1e-08")
    said = shown(GOOD, worse)
    assert "more than 10 times" in said and "(flexmb 1.2, AMD)" in said and "crosscheck run family/one --accept" in said
    assert "more than 10 times" not in shown(GOOD)


@pytest.mark.parametrize("stale", ["", "other efforts"])
def test_the_headline_alone_where_it_is_asked_for(stale: str) -> None:
    worse = msgspec.structs.replace(GOOD, worse="U is 1e-05, accepted were 1e-08", stale=stale)
    assert shown(worse, verbosity=Verbosity.QUIET).count("\n") == 1
