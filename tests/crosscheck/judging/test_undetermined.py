"""What the motion leaves open is compared with nothing, whoever gives numbers for it."""

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


def test_nobody_is_compared_in_what_one_says_is_open(tmp_path):
    outcome = judged(THREE, records(said=True))
    assert outcome.ok and {verdict.channel for verdict in outcome.all} == {TIP, FORCE}
    assert {(each.engine, each.channel) for each in outcome.inapplicable} == {
        (engine, TORQUE) for engine in ("one", "two", "three")
    }
    said = "not determined, as one says: closures are redundant, and infinitely many loads go with the same motion"
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


@pytest.mark.parametrize("silent", ["one", "two"])
def test_across_variants_either_side_may_say_so(silent):
    both = {TIP: way(), FORCE: way(), TORQUE: way()}
    runs = {"one": ladder("one", both), "two": ladder("two", both, variant="other")}
    assert {each.channel for each in judged(ACROSS, [*runs["one"], *runs["two"]]).all} == {TIP, FORCE, TORQUE}
    said = [run for name, each in runs.items() for run in (each if name == silent else without_torque(each))]
    outcome = judged(ACROSS, said)
    assert {verdict.channel for verdict in outcome.all} == {TIP, FORCE}
    assert {each.channel for each in outcome.inapplicable} == {TORQUE}


def test_an_engine_that_leaves_it_out_without_a_word_refuses_it():
    outcome = judged(THREE, records(said=False))
    assert not outcome.ok and {verdict.channel for verdict in outcome.all} == {TIP, FORCE, TORQUE}


def test_a_goal_of_open_loads_alone_is_no_misspelt_one():
    runs = [run for name in ("one", "two", "three") for run in without_torque(ladder(name, {TIP: way()}))]
    outcome = judged(THREE, runs)
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
