"""What the motion leaves open is compared with nothing, whoever gives numbers for it; what it is, no engine decides."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from crosscheck.engines.answers import BrokenContract, checked_run
from crosscheck.engines.contract import Effort, Run
from crosscheck.engines.native import NativeEngine
from crosscheck.report.ci import write_summary
from tests.crosscheck.fake_engines import Fake, Pendulum
from tests.crosscheck.fake_engines import engines as fakes
from tests.crosscheck.judging.test_applicable import junit, told
from tests.crosscheck.made_records import TIP, judged, ladder, way
from tests.crosscheck.sessions import compare_engines
from tests.flexmb.closure import mechanisms

TORQUE, FORCE = "load:pin.torque", "load:pin.force"
THREE = """
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
    outcome = judged(THREE, records(said=True), undetermined=(TORQUE,))
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
    outcome, alone = judged(THREE, [*records(said=True)]), judged(THREE, others)
    assert not outcome.ok and outcome.undetermined == 0
    mine = [each for each in outcome.all if "one" in (each.engine_a, each.engine_b)]
    assert {each.status for each in mine} == {"failed"} and all("determine" in each.reason for each in mine)
    theirs = [each for each in outcome.all if each not in mine]
    assert {each.channel: each.status for each in theirs} == dict.fromkeys((TIP, FORCE, TORQUE), "agree")
    assert {each.channel for each in alone.all if each.status == "agree"} == {TIP, FORCE}


def test_a_claim_in_a_record_that_does_not_say_what_the_scene_leaves_open_is_not_believed():
    outcome = judged(THREE, records(said=True), undetermined=msgspec.UNSET)
    assert not outcome.ok and outcome.undetermined == 0
    reasons = {each.reason for each in outcome.unexpected}
    assert len(reasons) == 1 and "run the case again" in reasons.pop()
    assert judged(THREE, records(said=False)[3:], undetermined=msgspec.UNSET).undetermined == 0


CONTROL = THREE + """
[[control]]
name = "too heavy"
mutation = "mass"
target = "bar"
a = { variant = "rigid", engine = "two" }
b = { variant = "rigid", engine = "three" }
goals = { "load:pin.torque" = 1e-3 }
"""


def test_a_control_that_is_compared_in_nothing_is_lost_and_the_session_red(tmp_path):
    faulty = ladder("two", {TIP: way(2.0), FORCE: way(2.0), TORQUE: way(2.0)}, role="control:too heavy")
    one = ladder("one", {TIP: way(), FORCE: way(), TORQUE: way()})
    seen = judged(CONTROL, [*one, *records(said=False)[3:], *faulty])
    assert seen.ok and seen.controls() == (1, 1) and not seen.lost_controls
    lost = judged(CONTROL, [*records(said=True), *faulty], undetermined=(TORQUE,))
    assert (lost.unexpected, lost.controls(), lost.ok) == ([], (0, 0), False)
    assert [each.control for each in lost.lost_controls] == ["too heavy"]
    assert lost.headline == "1 deliberate fault was compared in nothing"
    shown = told(lost)
    write_summary(lost, tmp_path / "summary.md")
    for text in (shown[1], (tmp_path / "summary.md").read_text(encoding="utf-8")):
        assert 'control "too heavy": none of its channels was compared (load:pin.torque)' in text.replace("\\", "")
    assert shown[0] == 1 and "1 not determined by the motion" in shown[1]
    assert [each.get("type") for each in junit(lost, tmp_path).iter("failure")] == ["nothing"]


def test_an_engine_that_leaves_it_out_without_a_word_refuses_it():
    outcome = judged(THREE, records(said=False))
    assert not outcome.ok and {verdict.channel for verdict in outcome.all} == {TIP, FORCE, TORQUE}


def test_a_goal_of_open_loads_alone_is_no_misspelt_one():
    runs = [run for name in ("one", "two", "three") for run in without_torque(ladder(name, {TIP: way()}))]
    outcome = judged(THREE, runs, undetermined=(TORQUE,))
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
    assert checked.undetermined == tuple(f"load:{name}.{part}" for name in names for part in ("force", "torque"))


def test_numbers_that_are_none_must_be_named(run):
    scene, times, found = run
    with pytest.raises(BrokenContract, match="not finite"):
        checked_run(replace(found, undetermined=()), times, scene)
    with pytest.raises(BrokenContract, match="channels of loads and drives"):
        checked_run(replace(found, undetermined=("energy.kinetic",)), times, scene)


@dataclass
class Claiming(Pendulum):
    """A pendulum, a tree, of which this engine says that its loads are undetermined; `void`: they are NaN."""

    void: bool = False

    def simulate(self, run, effort):
        found = super().simulate(run, effort)
        loads = {name: np.full_like(load, np.nan) if self.void else load for name, load in found.loads.items()}
        named = tuple(f"load:{name}.{part}" for name in loads for part in ("torque", "force"))
        return replace(found, loads=loads, undetermined=named)


class Claimer(Fake):
    def __init__(self, name, void):
        super().__init__(name)
        self.void = void

    def compile(self, scene):
        return Claiming(scene, void=self.void)


def with_claimers():
    return {**fakes(), "claimer": Claimer("claimer", False), "void": Claimer("void", True)}


@pytest.mark.parametrize("claimer", ["claimer", "void"])
def test_a_claim_on_a_tree_fails_its_author_and_moves_no_other_verdict(tmp_path: Path, claimer):
    one, other = list(fakes())[:2]
    goals = '"marker:tip.position" = 1e-3, load = 1e-3'
    provider = f"{__name__}:with_claimers"
    alone = compare_engines(tmp_path / "alone", (one, other), goals, provider=provider)
    beside = compare_engines(tmp_path / "beside", (one, other, claimer), goals, provider=provider)
    theirs = [each for each in beside.all if claimer not in (each.engine_a, each.engine_b)]
    assert {each.channel for each in theirs} > {TIP} and theirs == alone.all and not beside.inapplicable
    its_own = [each for each in beside.all if each not in theirs]
    assert its_own and {each.status for each in its_own} == {"failed"} and not beside.ok
    assert all("load:" in each.reason and "no closures or couplings" in each.reason for each in its_own)
