"""What an engine offers and nothing judges is told everywhere. In a strict session of an engine that the case names the
case must say why, and of a guest it must be as others have it.
What was asked for and is not there is never green either.
"""

from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from crosscheck.judging.outcome import SessionOutcome
from crosscheck.judging.verdict import SEVERITY
from crosscheck.library.accepted import Figure, key
from crosscheck.report.ci import write_summary
from crosscheck.report.junit import write_junit
from crosscheck.terminal.text import Verbosity
from flexmb.typing import Real
from tests.crosscheck.made_records import ONE_PAIR, PAIR, TIMES, TIP, ended, judged, ladder, told, way

VELOCITY = "marker:tip.velocity"
ASKED = ("one", "two", "guest")
REST = np.zeros((len(TIMES), 3))
NAMED = [
    *ladder("one", {TIP: way(), VELOCITY: way(axis=1), "momentum.linear": REST}),
    *ladder("two", {TIP: way(), VELOCITY: way(axis=1)}),
]


def session(values: Real | None, channel: str = VELOCITY, **options: object) -> SessionOutcome:
    """The outcome of a session with a guest that offers these values of a channel without a goal."""
    offered = {TIP: way()} | ({} if values is None else {channel: values})
    return judged(ONE_PAIR, [*NAMED, *ladder("guest", offered)], asked=ASKED, **options)


OPEN = """
[[open]]
channels = ["marker:*.velocity"]
reason = "it follows from the positions"
"""
OF_ONE = """
[[open]]
channels = ["momentum"]
engines = ["one"]
reason = "it rests"
"""


def whole(more: str = "", goals: str = "", **options: object) -> SessionOutcome:
    """The outcome of a session of the whole case, with more in its run file."""
    text = ONE_PAIR.replace("1e-3 }", f"1e-3{goals} }}") + more
    return judged(text, NAMED, whole=True, **options)


def test_a_strict_session_of_the_whole_case_fails_by_what_the_case_neither_judges_nor_leaves_open() -> None:
    outcome = whole(strict=True)
    offered = [("one", VELOCITY), ("one", "momentum.linear"), ("two", VELOCITY)]
    assert [(each.engine, each.channel) for each in outcome.unaccounted] == offered
    assert not outcome.ok and outcome.headline == "3 channels are offered and judged by nothing"
    code, text = told(outcome)
    assert code == 1 and f"one offers what nothing judges: {VELOCITY}, momentum.linear" in text
    assert "no [[open]] with a reason" in text
    lax = whole()
    assert lax.ok and "! made/made, rigid, two offers what nothing judges" in told(lax)[1]


def test_a_run_that_is_expected_to_agree_with_nothing_is_open_with_the_reason_of_that() -> None:
    """As long as nothing is expected to agree with it: otherwise what that does not name is silent."""
    differ = ONE_PAIR.replace("1e-3 }", '1e-3 }\nexpect = "differ"\nreason = "two is another model"')
    differ += 'band = { "marker:tip.position" = [0.1, 10] }\n'
    runs = [*NAMED[:3], *ladder("two", {TIP: way(2.0), VELOCITY: way(axis=1)})]
    outcome = judged(differ, runs, whole=True, strict=True)
    assert outcome.ok and {each.channel for each in outcome.unjudged} == {VELOCITY, "momentum.linear"}
    assert {each.reason for each in outcome.unjudged} == {
        "what is expected of it is differ, in 'both': two is another model"
    }
    agree = '[[comparison]]\nname = "more"\nvariant = "rigid"\ngoals = { "momentum.linear" = 1e-3 }\n'
    runs = [*NAMED[:3], *ladder("two", {TIP: way(2.0), VELOCITY: way(axis=1), "momentum.linear": REST})]
    outcome = judged(differ + agree, runs, whole=True, strict=True)
    assert {each.channel for each in outcome.unaccounted} == {VELOCITY}


def test_what_the_case_leaves_open_with_a_reason_is_told_with_it_and_is_no_error() -> None:
    outcome = whole(OPEN + OF_ONE, strict=True)
    assert outcome.ok and outcome.unaccounted == []
    assert {each.channel: each.reason for each in outcome.unjudged} == {
        VELOCITY: "it follows from the positions", "momentum.linear": "it rests",
    }  # fmt: skip
    assert "judged by nothing" in told(outcome)[1]


@pytest.mark.parametrize("more", [OPEN, OF_ONE, OPEN + OF_ONE.replace('"one"', '"two"')])
def test_what_is_left_open_is_open_for_these_channels_and_engines_alone(more: str) -> None:
    assert not whole(more, strict=True).ok


def test_a_goal_accounts_for_a_channel() -> None:
    outcome = whole(OF_ONE, ', "marker:tip.velocity" = 1e-3', strict=True)
    assert outcome.ok and [each.channel for each in outcome.unjudged] == ["momentum.linear"]


def test_what_a_case_leaves_open_is_held_against_others_where_a_guest_offers_it() -> None:
    offered = {TIP: way(), VELOCITY: -way(axis=1)}
    outcome = judged(ONE_PAIR + OPEN, [*NAMED, *ladder("guest", offered)], asked=ASKED, strict=True)
    assert [(each.engine, each.channel) for each in outcome.unaccounted] == [("guest", VELOCITY)]


def test_the_drift_of_the_energy_accounts_for_the_work_that_is_taken_off_it() -> None:
    energies = {"energy.total": np.ones((len(TIMES), 1)), "work": np.zeros((len(TIMES), 1))}
    text = ONE_PAIR.replace("1e-3 }", '1e-3, energy = 1e-3 }')
    conserved = '[[conservation]]\nvariant = "rigid"\nquantity = "energy"\nlimit = 1e-9\n'
    runs = [*ladder("one", {TIP: way()} | energies), *ladder("two", {TIP: way()} | energies)]
    left = [each.channel for each in judged(text, runs, whole=True).unjudged]
    assert left == ["work", "work"] and judged(text + conserved, runs, whole=True).unjudged == ()
    off = energies | {"work": np.ones((len(TIMES), 1))}  # no drift shows it
    outcome = judged(text + conserved, [*runs[:3], *ladder("two", {TIP: way()} | off)], whole=True, strict=True)
    assert [(each.engine, each.channel) for each in outcome.unaccounted] == [("two", "work")] and not outcome.ok


def test_what_engines_of_the_case_offer_is_no_error_where_some_were_asked_for_alone(tmp_path: Path) -> None:
    outcome = session(None, strict=True)
    offered = {(each.engine, each.channel): each.excused for each in outcome.unjudged}
    assert offered == dict.fromkeys([("one", VELOCITY), ("one", "momentum.linear"), ("two", VELOCITY)], True)
    assert outcome.unaccounted == [] and outcome.ok
    assert "3 agree, 3 offered and judged by nothing" in told(outcome)[1]
    line = f"made/made, rigid, one offers what nothing judges: {VELOCITY}, momentum.linear: the case has no goal for it"
    assert line in told(outcome, Verbosity.VERBOSE)[1] and line not in told(outcome)[1]
    write_summary(outcome, tmp_path / "summary.md")
    section = "## Offered, and judged by nothing\n\n- made/made, rigid, one offers"
    assert section in (tmp_path / "summary.md").read_text(encoding="utf-8")


def test_what_a_guest_offers_as_others_do_is_excused() -> None:
    outcome = session(way(axis=1), strict=True)
    (guest,) = [each for each in outcome.unjudged if each.engine == "guest"]
    assert guest.excused and guest.reason.endswith("the same as one gives")
    assert outcome.ok
    assert session(REST, "momentum.linear", strict=True).ok  # it is zero, and nothing measures it


@pytest.mark.parametrize("values", [
    pytest.param(-way(axis=1), id="reversed"), pytest.param(REST, id="zero"),
    pytest.param(2.0 * way(axis=1), id="doubled"), pytest.param(np.nan * way(axis=1), id="no numbers"),
    pytest.param(np.inf + way(axis=1), id="endless"), pytest.param(way(axis=1)[:, :1], id="of another shape"),
])  # fmt: skip
def test_what_a_guest_offers_otherwise_fails_a_strict_session_only(values: Real, tmp_path: Path) -> None:
    outcome = session(values, strict=True)
    (guest,) = outcome.unaccounted
    assert (guest.engine, guest.channel, outcome.ok) == ("guest", VELOCITY, False)
    assert outcome.headline == "1 channel is offered and judged by nothing"
    code, text = told(outcome)
    assert code == 1 and f"✕ made/made, rigid, guest offers what nothing judges: {VELOCITY}" in text
    write_junit(outcome, tmp_path / "junit.xml")
    root = ElementTree.parse(tmp_path / "junit.xml").getroot()
    (failure,) = root.findall(".//failure")
    assert "judged by nothing" in str(failure.get("message")) and root.get("failures") == "1"
    lax = session(values)
    assert lax.ok and "! made/made, rigid, guest offers what nothing judges" in told(lax)[1]


@pytest.mark.parametrize("size", [1e-15, 1e-9, 1.0, 1e9])
def test_what_is_the_same_is_measured_by_the_size_of_the_channel(size: float) -> None:
    """A distance of 1e-9 m/s is all that a very small system has, and nothing of a large one."""
    named = [*NAMED[:3], *ladder("two", {TIP: way(), VELOCITY: size * way(axis=1)})]
    named = [run for run in named if run.engine == "two"]
    for factor, same in ((1.0, True), (1.0 + 1e-12, True), (-1.0, False), (0.0, False), (2.0, False)):
        guest = ladder("guest", {TIP: way(), VELOCITY: factor * size * way(axis=1)}, spread=0.0)
        outcome = judged(ONE_PAIR, [*ladder("one", {TIP: way()}), *named, *guest], asked=ASKED, strict=True)
        assert outcome.ok == same, (size, factor)


def test_work_begins_at_zero_by_the_size_of_the_energy() -> None:
    """A work that is wrong by a constant has no drift: it may be as small as the rounding of a small energy only."""
    conserved = '[[conservation]]\nvariant = "rigid"\nquantity = "energy"\nlimit = 1e-9\n'
    for start, accounted in ((1e-22, True), (1e-12, False)):
        energies = {"energy.total": np.full((len(TIMES), 1), 1e-12), "energy.kinetic": np.full((len(TIMES), 1), 1e-12)}
        energies["work"] = np.full((len(TIMES), 1), start)
        runs = [*ladder("one", {TIP: way()} | energies), *ladder("two", {TIP: way()} | energies)]
        left = {each.channel for each in judged(ONE_PAIR + conserved, runs, whole=True).unjudged}
        assert ("work" not in left) == accounted, start


def test_what_nobody_else_offers_cannot_be_held_against_anything() -> None:
    outcome = session(way(), "marker:tip.angular_velocity", strict=True)
    (guest,) = outcome.unaccounted
    assert guest.reason.endswith("no other engine of the variant offers it") and not outcome.ok


def test_a_control_accounts_for_nothing() -> None:
    control = """
[[control]]
name = "heavier"
mutation = "mass"
a = { variant = "rigid", engine = "one" }
b = { variant = "rigid", engine = "two" }
goals = { "marker:tip.velocity" = 1e-3 }
"""
    faulty = ladder("one", {TIP: way(), VELOCITY: way(2.0, axis=1)}, role="control:heavier")
    outcome = judged(ONE_PAIR + control, [*NAMED, *faulty])
    assert outcome.controls() == (1, 1)
    assert {(each.engine, each.channel) for each in outcome.unjudged} >= {("one", VELOCITY), ("two", VELOCITY)}


BESIDE = ONE_PAIR.replace('engines = ["one", "two"]', 'engines = ["one", "two"]\nalso = ["three"]', 1)
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
