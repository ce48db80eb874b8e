"""What a guest among the engines cannot represent is not applicable; nobody else may refuse, and nobody do nothing.

What the motion leaves open is compared with nothing; what that is, no engine decides.
"""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import msgspec
import numpy as np
import pytest

from crosscheck.engines.answers import BrokenContract, checked_run
from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.native import NativeEngine
from crosscheck.judging.outcome import SessionOutcome
from crosscheck.library.accepted import Figure, key
from crosscheck.records.kinds import RunRecord
from crosscheck.records.packing import pack, unpack
from crosscheck.report.ci import write_summary
from crosscheck.report.junit import write_junit
from crosscheck.terminal.text import Verbosity
from tests.crosscheck.made_records import ONE_PAIR, PAIR, TIP, ended, judged, ladder, told, way
from tests.flexmb.closure import mechanisms

VELOCITY = "marker:tip.velocity"
BOTH = ONE_PAIR.replace("marker:tip.position", "marker")
THREE = ("one", "two", "guest")


def without_result(engine: str, status: str = "refused", why: str = "it has no hinges") -> RunRecord:
    return ended(ladder(engine, {TIP: way()})[-1], status, why, effort="", times=None, channels={})


def junit(outcome: SessionOutcome, folder: Path) -> ElementTree.Element:
    write_junit(outcome, folder / "junit.xml")
    root = ElementTree.parse(folder / "junit.xml").getroot()
    for what in ("failure", "skipped"):
        attribute = "failures" if what == "failure" else what
        assert sum(int(suite.get(attribute, "0")) for suite in root) == len(root.findall(f".//{what}"))
    return root


def test_a_guest_that_refuses_is_listed_once_and_is_no_verdict() -> None:
    elsewhere = judged(ONE_PAIR, [*PAIR, *ladder("guest", {TIP: way()})], asked=THREE)
    assert (len(elsewhere.all), elsewhere.ok) == (3, True)
    outcome = judged(ONE_PAIR, [*PAIR, without_result("guest")], asked=THREE)
    (apart,) = outcome.inapplicable
    assert (apart.engine, apart.where, apart.reason) == ("guest", "rigid", "it has no hinges")
    assert (len(outcome.all), outcome.absences, outcome.unexpected) == (1, [], [])
    assert outcome.never_applicable == {"guest": ["made/made"]}


def test_a_guest_that_is_compared_elsewhere_leaves_the_session_green(tmp_path: Path) -> None:
    """It has two variants here, and refuses one of them."""
    text = ONE_PAIR + ONE_PAIR.replace('"rigid"', '"slow"').replace('"both"', '"again"')
    slow = [*ladder("one", {TIP: way()}, variant="slow"), *ladder("two", {TIP: way()}, variant="slow")]
    guest = [*ladder("guest", {TIP: way()}), without_result("guest")]
    guest[-1] = ended(guest[-1], "refused", "too slow", variant="slow")
    outcome = judged(text, [*PAIR, *slow, *guest], asked=("guest",))
    assert (len(outcome.all), outcome.ok, outcome.never_applicable) == (2, True, {})
    root = junit(outcome, tmp_path)
    (skipped,) = (test for test in root.iter("testcase") if test.find("skipped") is not None)
    assert skipped.get("name") == "slow by guest"
    assert skipped.find("skipped").get("message") == "not applicable: too slow"  # type: ignore[union-attr]
    write_summary(outcome, tmp_path / "summary.md")
    assert "## Not applicable\n\n- made/made, slow, guest: too slow" in (tmp_path / "summary.md").read_text()
    code, text = told(outcome, Verbosity.VERBOSE)
    assert code == 0 and "made/made, slow, guest not applicable: too slow" in text


def test_who_was_asked_for_and_compared_in_nothing_is_red(tmp_path: Path) -> None:
    outcome = judged(ONE_PAIR, [*PAIR, without_result("guest")], asked=THREE)
    assert (outcome.ok, outcome.uncompared) == (False, ["guest"])
    assert outcome.headline == "guest was asked for and compared in nothing"
    (failure,) = junit(outcome, tmp_path).findall(".//failure")
    assert failure.get("message") == "it was asked for and compared in nothing"
    code, text = told(outcome)
    assert code == 1 and "✕ guest was asked for and compared in nothing: made/made: it has no hinges" in text
    assert "1 agree, guest not applicable in 1" in text
    only = judged(ONE_PAIR, [*PAIR, without_result("guest")], asked=("guest",))
    assert (only.ok, only.all, only.idle) == (False, [], [])
    assert only.headline == "Nothing was compared: guest was asked for and compared in nothing"
    assert len(junit(only, tmp_path).findall(".//failure")) == 1


def test_an_engine_that_the_case_names_beside_its_comparisons_only_is_compared_in_nothing() -> None:
    beside = ONE_PAIR.replace('engines = ["one", "two"]', 'engines = ["one", "two"]\nalso = ["three"]', 1)
    runs = [*PAIR, *ladder("three", {TIP: way()})]
    assert judged(beside, runs).ok
    assert judged(beside, runs, asked=("one", "two", "three")).uncompared == ["three"]


@pytest.mark.parametrize("status", ["failed", "crashed", "did not finish", "did not run", "diverged"])
def test_only_a_refusal_is_not_applicable(status: str) -> None:
    outcome = judged(ONE_PAIR, [*PAIR, without_result("guest", status)], asked=THREE)
    assert (outcome.ok, outcome.inapplicable, len(outcome.unexpected)) == (False, (), 2)


def test_an_engine_that_the_case_names_may_not_refuse() -> None:
    runs = [*PAIR[:3], without_result("two"), *ladder("guest", {TIP: way()})]
    outcome = judged(ONE_PAIR, runs, asked=("guest",))
    assert [verdict.status for verdict in outcome.unexpected] == ["refused"]
    both = judged(ONE_PAIR, [*PAIR[:3], without_result("two"), without_result("guest")], asked=("guest",))
    assert [verdict.engine_a for verdict in both.unexpected] == ["two"]


@pytest.mark.parametrize("status", ["crashed", "failed", "did not run"])
def test_a_partner_that_breaks_down_is_not_hidden_by_a_guest_that_refuses(status: str) -> None:
    runs = [*PAIR[:3], without_result("two", status), without_result("guest")]
    assert {verdict.status for verdict in judged(ONE_PAIR, runs, asked=("guest",)).unexpected} == {status}


def test_a_channel_that_a_guest_does_not_offer_is_not_applicable_and_told_once() -> None:
    two = [ladder(engine, {TIP: way(), VELOCITY: way()}) for engine in ("one", "two")]
    outcome = judged(BOTH, [*two[0], *two[1], *ladder("guest", {TIP: way()})], asked=THREE)
    assert (outcome.ok, len(outcome.all)) == (True, 4)
    (apart,) = outcome.inapplicable
    assert (apart.where, apart.reason) == (f"rigid, {VELOCITY}", "guest does not offer it")
    assert outcome.headline == "All 4 verdicts are as expected; not offered and not judged: guest 1 channel"
    assert "1 case: 4 agree, 1 not offered by guest" in told(outcome)[1]
    named = judged(BOTH, [*two[0], *ladder("two", {TIP: way()}), *ladder("guest", {TIP: way()})], asked=THREE)
    assert {verdict.pair for verdict in named.unexpected} == {"one – two"}


def test_an_energy_that_a_guest_does_not_know_is_counted_too() -> None:
    """A kind of energy that one side does not know is no refusal of it; but of a guest it is told."""
    text = ONE_PAIR.replace("goals = {", 'goals = { "energy" = 1e-3,')
    known = {TIP: way(), "energy.kinetic": way()}
    pair = [*ladder("one", known), *ladder("two", known)]
    outcome = judged(text, [*pair, *ladder("guest", {TIP: way()})], asked=THREE)
    assert (outcome.ok, outcome.not_offered) == (True, {"guest": 1})
    assert [each.where for each in outcome.inapplicable] == ["rigid, energy.kinetic"]
    assert judged(text, [*pair, *ladder("guest", known)], asked=THREE).not_offered == {}
    unasked = judged(ONE_PAIR, [*pair, *ladder("guest", {TIP: way()})], asked=THREE)
    assert (unasked.ok, unasked.inapplicable) == (True, ())


def test_what_no_guest_offers_is_not_applicable_to_them() -> None:
    text = ONE_PAIR.replace("goals = {", 'goals = { "drive" = 1e-3,')
    guests = [*ladder("guest", {TIP: way()}), *ladder("second", {TIP: way()})]
    outcome = judged(text, guests, asked=("guest", "second"))
    assert (outcome.ok, len(outcome.all)) == (True, 1)
    assert [(each.engine, each.channel) for each in outcome.inapplicable] == [("guest", "drive"), ("second", "drive")]
    mixed = judged(text, [*ladder("one", {TIP: way()}), *ladder("guest", {TIP: way()})], asked=("one", "guest"))
    assert [(verdict.channel, verdict.status) for verdict in mixed.unexpected] == [("drive", "did not run")]


def test_a_guest_with_accepted_figures_is_expected_to_go_on() -> None:
    accepted = {"both": {key(TIP, ("one", "rigid"), ("guest", "rigid")): Figure(1e-6, 1e-4)}}
    outcome = judged(ONE_PAIR, [*PAIR, without_result("guest")], accepted, asked=THREE)
    assert (outcome.inapplicable, {verdict.status for verdict in outcome.unexpected}) == ((), {"refused"})


def test_a_recipe_without_reference_is_told_and_with_strict_an_error(tmp_path: Path) -> None:
    outcome = judged(ONE_PAIR, PAIR, unreferenced=True)
    assert (outcome.ok, outcome.unreferenced) == (True, ("made/made",))
    said = "made/made has a recipe of a reference, no reference yet: crosscheck regenerate made/made"
    assert f"! {said}" in told(outcome)[1]
    (skipped,) = junit(outcome, tmp_path).findall(".//skipped")
    assert skipped.get("message") == said
    write_summary(outcome, tmp_path / "summary.md")
    assert f"## No stored reference\n\n- {said}" in (tmp_path / "summary.md").read_text()
    accepted = {"both": {key(TIP, ("one", "rigid"), ("two", "rigid")): Figure(1e-3, 1e-3)}}
    strict = judged(ONE_PAIR, PAIR, accepted, strict=True, unreferenced=True)
    assert (strict.ok, strict.headline) == (False, "1 case has a recipe and no reference")
    assert told(strict)[0] == 1 and len(junit(strict, tmp_path).findall(".//failure")) == 1
    assert judged(ONE_PAIR, PAIR, accepted, strict=True).ok


TORQUE, FORCE = "load:pin.torque", "load:pin.force"
THREE_OPEN = """
[[variant]]
name = "rigid"
engines = ["one", "two", "three"]

[[comparison]]
name = "all"
variant = "rigid"
engines = ["one", "two", "three"]
goals = { "marker:tip.position" = 1e-3, load = 1e-3 }
"""


def without_torque(runs):
    return [msgspec.structs.replace(run, undetermined=(TORQUE,)) for run in runs]


def records(*, said: bool):
    """Two engines that agree on everything and one that has no torque, and says why or does not."""
    one = ladder("one", {TIP: way(), FORCE: way()})
    both = {TIP: way(), FORCE: way(), TORQUE: way()}
    return (without_torque(one) if said else one) + ladder("two", both) + ladder("three", both)


def test_nobody_is_compared_in_what_the_motion_leaves_open(tmp_path):
    outcome = judged(THREE_OPEN, records(said=True), undetermined=(TORQUE,))
    assert outcome.ok and {verdict.channel for verdict in outcome.all} == {TIP, FORCE}
    assert {(each.engine, each.channel) for each in outcome.inapplicable} == {
        (engine, TORQUE) for engine in ("one", "two", "three")
    }
    assert (outcome.not_offered, outcome.undetermined, outcome.never_applicable) == ({}, 1, {})
    assert "not determined and not judged: 1 channel" in outcome.headline
    said = "not determined: closures are redundant, and infinitely many loads go with the same motion"
    assert all(each.reason == said for each in outcome.inapplicable)
    write_summary(outcome, tmp_path / "summary.md")
    assert "not determined" in (tmp_path / "summary.md").read_text(encoding="utf-8")


PART = "load:pin.torque[y]"


def with_other_y(runs):
    """The runs with other numbers in the second component of the torque."""
    changed = []
    for run in runs:
        rows = unpack(run.channels[TORQUE])
        rows[:, 1] += 5.0
        changed.append(msgspec.structs.replace(run, channels=run.channels | {TORQUE: pack(rows)}))
    return changed


def test_an_open_component_is_not_compared_and_those_beside_it_are(tmp_path):
    both = {TIP: way(), FORCE: way(), TORQUE: way()}
    runs = [*ladder("one", both), *with_other_y(ladder("two", both)), *ladder("three", both)]
    assert {each.channel for each in judged(THREE_OPEN, runs).unexpected} == {TORQUE}
    outcome = judged(THREE_OPEN, runs, undetermined=(PART,), strict=True)
    assert not outcome.unexpected and not outcome.unjudged
    assert {each.channel for each in outcome.all} == {TIP, FORCE, TORQUE}
    assert {each.reason.rpartition("; ")[2] for each in outcome.all if each.channel == TORQUE} == {
        "y not determined and not compared"
    }
    assert {(each.engine, each.channel, each.kind) for each in outcome.inapplicable} == {
        (engine, PART, "partly determined") for engine in ("one", "two", "three")
    }
    assert (outcome.undetermined, outcome.partly_determined) == (0, 1)
    outcome = judged(THREE_OPEN, runs, undetermined=(PART,))
    assert outcome.ok and "not determined and not judged: components of 1 channel" in outcome.headline
    write_summary(outcome, tmp_path / "summary.md")
    assert PART in (tmp_path / "summary.md").read_text(encoding="utf-8").replace("\\", "")
    assert "1 determined in some components" in told(outcome)[1]
    other = judged(THREE_OPEN, runs, undetermined=("load:pin.torque[x]",))
    assert {each.channel for each in other.unexpected} == {TORQUE}


def test_a_claim_of_a_whole_channel_that_is_open_in_part_fails_its_author():
    outcome = judged(THREE_OPEN, records(said=True), undetermined=(PART,))
    mine = [each for each in outcome.all if "one" in (each.engine_a, each.engine_b)]
    assert mine and all(each.status == "failed" and "'load:pin.torque[x, z]'" in each.reason for each in mine)
    assert all(each.ok for each in outcome.all if each not in mine)


ACROSS = """
[[variant]]
name = "rigid"
engines = ["one"]

[[variant]]
name = "other"
engines = ["two"]

[[comparison]]
name = "both"
a = { variant = "rigid", engine = "one" }
b = { variant = "other", engine = "two" }
goals = { "marker:tip.position" = 1e-3, load = 1e-3 }
"""


def test_across_variants_what_either_leaves_open_is_not_compared():
    both = {TIP: way(), FORCE: way(), TORQUE: way()}
    runs = [*ladder("one", both), *ladder("two", both, variant="other")]
    assert {each.channel for each in judged(ACROSS, runs).all} == {TIP, FORCE, TORQUE}
    outcome = judged(ACROSS, runs, undetermined=(TORQUE,))
    assert {verdict.channel for verdict in outcome.all} == {TIP, FORCE}
    assert {each.channel for each in outcome.inapplicable} == {TORQUE}


def test_a_contrary_claim_fails_its_author_and_changes_no_verdict_of_others():
    """As of an older session, whose engines decided: a claim on a tree, or on a load that the closures determine."""
    others = [*ladder("two", {TIP: way(), FORCE: way(), TORQUE: way()}), *ladder("three", {TIP: way(), FORCE: way()})]
    outcome, alone = judged(THREE_OPEN, [*records(said=True)]), judged(THREE_OPEN, others)
    assert not outcome.ok and outcome.undetermined == 0
    mine = [each for each in outcome.all if "one" in (each.engine_a, each.engine_b)]
    assert {each.status for each in mine} == {"failed"} and all("determine" in each.reason for each in mine)
    theirs = [each for each in outcome.all if each not in mine]
    assert {each.channel: each.status for each in theirs} == dict.fromkeys((TIP, FORCE, TORQUE), "agree")
    assert {each.channel for each in alone.all if each.status == "agree"} == {TIP, FORCE}


def test_a_claim_in_a_record_that_does_not_say_what_the_scene_leaves_open_is_not_believed():
    outcome = judged(THREE_OPEN, records(said=True), undetermined=msgspec.UNSET)
    assert not outcome.ok and outcome.undetermined == 0
    reasons = {each.reason for each in outcome.unexpected}
    assert len(reasons) == 1 and "run the case again" in reasons.pop()
    assert judged(THREE_OPEN, records(said=False)[3:], undetermined=msgspec.UNSET).undetermined == 0


CONTROL = (
    THREE_OPEN
    + """
[[control]]
name = "too heavy"
mutation = "mass"
target = "bar"
a = { variant = "rigid", engine = "two" }
b = { variant = "rigid", engine = "three" }
goals = { "load:pin.torque" = 1e-3 }
"""
)


def test_a_control_that_is_compared_in_nothing_is_lost_and_the_session_red(tmp_path):
    faulty = ladder("two", {TIP: way(2.0), FORCE: way(2.0), TORQUE: way(2.0)}, role="control:too heavy")
    one = ladder("one", {TIP: way(), FORCE: way(), TORQUE: way()})
    seen = judged(CONTROL, [*one, *records(said=False)[3:], *faulty])
    assert seen.ok and seen.controls() == (1, 1) and not seen.lost_controls
    lost = judged(CONTROL, [*records(said=True), *faulty], undetermined=(TORQUE,))
    assert (lost.unexpected, lost.controls(), lost.ok) == ([], (0, 0), False)
    assert [control.control for control in lost.lost_controls] == ["too heavy"]
    assert lost.headline == "1 deliberate fault was compared in nothing"
    shown = told(lost)
    write_summary(lost, tmp_path / "summary.md")
    for text in (shown[1], (tmp_path / "summary.md").read_text(encoding="utf-8")):
        assert 'control "too heavy": none of its channels was compared (load:pin.torque)' in text.replace("\\", "")
    assert shown[0] == 1 and "1 not determined by the motion" in shown[1]
    assert [each.get("type") for each in junit(lost, tmp_path).iter("failure")] == ["nothing"]


def test_an_engine_that_leaves_it_out_without_a_word_refuses_it():
    outcome = judged(THREE_OPEN, records(said=False))
    assert not outcome.ok and {verdict.channel for verdict in outcome.all} == {TIP, FORCE, TORQUE}


def test_a_goal_of_open_loads_alone_is_no_misspelt_one():
    runs = [run for name in ("one", "two", "three") for run in without_torque(ladder(name, {TIP: way()}))]
    outcome = judged(THREE_OPEN, runs, undetermined=(TORQUE,))
    assert outcome.ok and {verdict.channel for verdict in outcome.all} == {TIP}


@pytest.fixture(scope="module")
def run():
    """A planar four-bar closed in space: nothing determines its loads out of the plane."""
    scene = mechanisms.four_bar()
    times = np.array([0.0, 0.01])
    found = NativeEngine().compile(scene).simulate(Run(times), Effort("tolerance", 1e-8, "dop853"))
    return scene, times, found


def test_our_own_engine_names_open_loads_and_the_contract_takes_them(run):
    scene, times, found = run
    checked = checked_run(found, times, scene)
    names = ("drive", "loop", "pin", "pivot")
    parts = "force[z]", "torque[x, y]"
    assert checked.undetermined == tuple(f"load:{name}.{part}" for name in names for part in parts)
    whole = tuple(f"load:{name}.{part}" for name in names for part in ("force", "torque"))  # judged by the scene later
    assert checked_run(replace(found, undetermined=whole), times, scene).undetermined == whole
    with pytest.raises(BrokenContract, match=r"loads\['drive'\] is not finite"):
        checked_run(replace(found, undetermined=(*checked.undetermined[2:], "load:drive.torque[x, z]")), times, scene)


def test_numbers_that_are_none_must_be_named(run):
    scene, times, found = run
    with pytest.raises(BrokenContract, match="not finite"):
        checked_run(replace(found, undetermined=()), times, scene)
    with pytest.raises(BrokenContract, match="channels of loads and drives"):
        checked_run(replace(found, undetermined=("energy.kinetic",)), times, scene)
