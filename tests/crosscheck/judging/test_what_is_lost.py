"""What was asked for and is not there is never green, even where nothing was to be compared with it."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import msgspec
import pytest

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import SEVERITY
from crosscheck.library.accepted import Figure, key
from crosscheck.report.junit import write_junit
from tests.crosscheck.made_records import ONE_PAIR, TIP, ended, judged, ladder, way

BESIDE = ONE_PAIR.replace('engines = ["one", "two"]', 'engines = ["one", "two"]\nalso = ["three"]', 1)
PAIR = [*ladder("one", {TIP: way()}), *ladder("two", {TIP: way()})]
VELOCITY = "marker:tip.velocity"
WIDE = ONE_PAIR.replace("marker:tip.position", "marker")


def failures(outcome: SessionOutcome, folder: Path) -> int:
    """How many failures junit.xml holds, counted twice."""
    write_junit(outcome, folder / "junit.xml")
    root = ElementTree.parse(folder / "junit.xml").getroot()
    stated = sum(int(suite.get("failures")) for suite in root)
    assert stated == len(root.findall(".//failure"))
    return stated


JUDGED = ("agree", "differ", "unresolved")


@pytest.mark.parametrize("status", [None, *(each for each in SEVERITY if each not in JUDGED)])
def test_an_engine_beside_the_comparisons_may_refuse_or_diverge_but_not_fail(
    status: str | None, tmp_path: Path
) -> None:
    assert judged(BESIDE, [*PAIR, *ladder("three", {TIP: way()})]).ok
    last = ended(ladder("three", {TIP: way()})[-1], status or "", "so it was", effort="", times=None, channels={})
    outcome = judged(BESIDE, [*PAIR, *([last] if status else [])])
    honest = status in ("refused", "diverged")
    assert (len(outcome.all), outcome.ok, failures(outcome, tmp_path)) == (1, honest, 0 if honest else 1)
    assert honest or outcome.headline == "1 run asked for gave no result"


def test_what_a_verdict_expects_is_not_lost() -> None:
    text = ONE_PAIR + 'expect = "failed"\nbecause = "so it was"\nreason = "it does"\n'
    last = ended(ladder("two", {TIP: way()})[-1], "failed", "so it was", effort="", times=None, channels={})
    outcome = judged(text, [*ladder("one", {TIP: way()}), last])
    assert (outcome.ok, outcome.lost) == (True, [])


def test_junit_fails_wherever_the_exit_code_does(tmp_path: Path) -> None:
    """A channel that nobody has did not run either, and there is no lost run whose failure could stand for it."""
    nobody = judged(ONE_PAIR, [*ladder("one", {VELOCITY: way()}), *ladder("two", {VELOCITY: way()})])
    assert (nobody.ok, nobody.lost, failures(nobody, tmp_path)) == (False, [], 1)
    absent = judged(ONE_PAIR, ladder("one", {TIP: way()}))
    assert (absent.ok, len(absent.lost), failures(absent, tmp_path)) == (False, 1, 1)


@pytest.mark.parametrize("gone", [TIP, VELOCITY, "energy.strain"])
def test_a_channel_with_accepted_figures_does_not_vanish_in_silence(gone: str) -> None:
    names = (TIP, VELOCITY, "energy.strain", "energy.total")
    text = WIDE.replace("goals = {", 'goals = { "energy" = 1e-3,')
    accepted = {"both": {key(name, ("one", "rigid"), ("two", "rigid")): Figure(1e-6, 1e-4) for name in names}}

    def runs(*lacking: str) -> list:
        signals = {name: way() if name.startswith("marker") else way()[:, :1] for name in names}
        sound = ladder("one", signals)
        left = {name: values for name, values in signals.items() if name not in lacking}
        return [*(sound if gone == "energy.strain" else ladder("one", left)), *ladder("two", left)]

    assert judged(text, runs(), accepted).ok
    assert judged(text, runs(gone)).ok
    (lost,) = judged(text, runs(gone), accepted).unexpected
    assert (lost.channel, lost.status) == (gone, "did not run")
    why = "it has accepted figures and is not judged any more: take them out of accepted.toml if that is meant"
    assert (lost.reason, lost.outside) == (why, why)
    missing = msgspec.structs.replace(runs()[0], status="crashed", effort="", channels={}, times=None)
    assert {each.status for each in judged(text, [*runs()[3:], missing], accepted).unexpected} == {"crashed"}


def test_a_scale_of_a_control_that_names_nothing_is_not_left_out_in_silence() -> None:
    control = """
[[control]]
name = "too heavy"
mutation = "mass"
a = { variant = "rigid", engine = "one" }
b = { variant = "rigid", engine = "two" }
goals = { "marker:tip.position" = 1e-3 }
scales = { "marker:top.position" = 1.0 }
"""
    faulty = ladder("one", {TIP: way(1.1)}, role="control:too heavy")[-1]
    last = judged(ONE_PAIR + control, [*PAIR, faulty]).all[-1]
    assert (last.kind, last.channel, last.ok, last.goal) == ("control", "marker:top.position", False, 0.0)
    assert last.reason == 'a scale is given for "marker:top.position", which is no channel judged here'
    (without,) = (each for each in judged(ONE_PAIR + control, [*PAIR[:3], faulty]).all if each.kind == "control")
    assert (without.channel, without.status) == (TIP, "did not run")
    assert judged(ONE_PAIR + control.replace("top", "tip"), [*PAIR, faulty]).ok


def test_a_run_that_finished_at_no_effort_is_a_failure() -> None:
    """A damaged record: there is nothing to compare, and there was a traceback."""
    damaged = msgspec.structs.replace(ladder("two", {TIP: way()})[-1], effort="", times=None, channels={})
    outcome = judged(ONE_PAIR, [*ladder("one", {TIP: way()}), damaged])
    assert not outcome.ok and "its record names no effort" in outcome.all[0].reason
