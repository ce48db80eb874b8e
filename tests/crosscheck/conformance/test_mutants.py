"""What outsiders got wrong in adapters is noticed by the contract, and a small sound adapter keeps all of it; so it is
in single precision, with bounds of that unit roundoff.
"""

import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.conformance.clause import POINTWISE, ROUNDINGS, Clause, allowance
from crosscheck.conformance.trees import TREES
from crosscheck.conformance.trial import try_clause, verdict_on
from crosscheck.engines.contract import UNIT_ROUNDOFF, Effort, Engine, Model, Support
from crosscheck.engines.registry import engine
from flexmb.scene.schema import Scene
from tests.crosscheck.conformance.mutants import EQUIVALENT, MISREADINGS, MUTANTS, Misread, Mutant, mutated
from tests.crosscheck.conformance.small_adapter import SmallEngine
from tests.repo.project import ROOT

PAGE = ROOT / "docs" / "howto" / "engine.md"
ENOUGH = 0.95  # of all mutants that are not equivalent
BY_NAME = {mutant.name: mutant for mutant in MUTANTS}

PINNED = {
    "inner-hinges-carry-their-frames": "all bodies have the frame of the last one",
    "inner-hinges-add-their-velocities": "the parent's turn moves no child",
    "inner-hinges-accelerate": "children's loads of the other sign",
    "branches-hang-on-their-parents": "every body hangs on the one before it",
    "order-of-declaration-does-not-matter": "bodies in the order of their declaration",
    "loads-pass-through-a-chain": "loads in body axes",
    "loads-at-nodes-act-in-a-chain": "node axes without the node's turn",
    "inner-motors-react-on-their-parent": "springs without their rest",
    "an-inner-slide-moves-along-its-axis": "half the Coriolis acceleration",
    "an-inner-weld-holds-fast": "products of inertia of the other sign",
    "an-inner-ball-turns-in-outboard-axes": "ball speeds in inboard axes",
    "an-inner-free-hinge-is-relative-to-its-parent": "free velocities in inboard axes",
    "an-inner-drive-moves-all-outboard": "a prescribed coordinate that moves others not",
    "a-wheel-rides-on-an-inner-body": "a wheel's spin inertia twice",
    "a-point-mass-rides-on-an-inner-body": "point masses all on the first body",
    "momentum-and-energy-are-sums-over-bodies": "momentum of the last body",
}
"""For each clause on rigid trees a mutant that it notices."""
PINNED_RUNS = {
    "a-tree-swings": "the turn at the child dropped",
    "outputs-of-a-tree-hold-at-every-sample": "loads on the inboard body",
    "springs-and-motors-move-a-tree": "dampers that drive",
    "what-changes-with-time-moves-a-tree": "loads at their value of t = 0",
    "work-is-what-the-energy-of-a-tree-gains": "work without drives",
}
"""The same for clauses on runs, which take seconds: all but the first are among the slow ones."""
PINNED_MISREADINGS = {
    "a-child-rides-on-the-deformed-node": "children on the undeformed node",
    "a-flexible-inner-body-is-loaded-by-its-child": "the order of the stiffness of modes",
}
NEEDS_A_RUN = "a-tree-with-a-flexible-body-swings"  # which takes longer, and is among the slow ones


def noticed(tried: Engine, clauses: list[Clause]) -> str:
    """The first clause that is broken, "" if none is."""
    return next((clause.name for clause in clauses if try_clause(tried, clause).status == "broken"), "")


def quick_ones_first() -> list[Clause]:
    """Snapshots before runs, which take longer."""
    runs = re.compile("run|tree|swings|flies|kept|efforts|balance|rate-of")
    return sorted(CLAUSES.values(), key=lambda clause: bool(runs.search(clause.name)))


@pytest.mark.parametrize("clause", PINNED)
def test_a_wrong_adapter_breaks_a_clause_on_trees(clause: str) -> None:
    assert try_clause(SmallEngine(), CLAUSES[clause]).status == "holds"
    found = try_clause(mutated(BY_NAME[PINNED[clause]]), CLAUSES[clause])
    assert found.status == "broken", found


@pytest.mark.parametrize(
    "clause", [pytest.param(name, marks=() if name == "a-tree-swings" else pytest.mark.slow) for name in PINNED_RUNS]
)
def test_a_wrong_adapter_breaks_a_clause_on_runs_of_trees(clause: str) -> None:
    assert try_clause(SmallEngine(), CLAUSES[clause]).status == "holds"
    found = try_clause(mutated(BY_NAME[PINNED_RUNS[clause]]), CLAUSES[clause])
    assert found.status == "broken", found


@pytest.mark.parametrize("clause", PINNED_MISREADINGS)
def test_a_misread_flexible_body_breaks_a_clause_on_trees(clause: str) -> None:
    assert try_clause(engine("native"), CLAUSES[clause]).status == "holds"
    found = try_clause(Misread(MISREADINGS[PINNED_MISREADINGS[clause]]), CLAUSES[clause])
    assert found.status == "broken", found


def test_every_clause_on_trees_has_its_mutant() -> None:
    assert {clause.name for clause in TREES.clauses} == {*PINNED, *PINNED_RUNS, *PINNED_MISREADINGS, NEEDS_A_RUN}


def test_a_mutant_whose_text_is_not_there_is_refused() -> None:
    with pytest.raises(ValueError, match="occurs 0 times"):
        mutated(Mutant("none", "no such text", ""))


@pytest.mark.slow
def test_the_small_adapter_keeps_the_whole_contract() -> None:
    found = {name: try_clause(SmallEngine(), clause) for name, clause in CLAUSES.items()}
    assert {name: each.message for name, each in found.items() if each.status not in ("holds", "not offered")} == {}


@pytest.mark.slow
def test_a_flexible_tree_that_does_not_swing_as_it_should_is_noticed() -> None:
    clause = CLAUSES[NEEDS_A_RUN]
    assert try_clause(engine("native"), clause).status == "holds"
    assert try_clause(Misread(MISREADINGS["damping of modes dropped"]), clause).status == "broken"


@pytest.mark.slow
def test_the_contract_notices_what_outsiders_got_wrong() -> None:
    """All of it but what is equivalent; the page says how many."""
    clauses = quick_ones_first()
    found = {mutant.name: noticed(mutated(mutant), clauses) for mutant in MUTANTS}
    found |= {name: noticed(Misread(change), list(CLAUSES.values())) for name, change in MISREADINGS.items()}
    survivors = {name for name, clause in found.items() if not clause}
    assert set(EQUIVALENT) <= survivors, "a mutant that is said to change no answer is noticed"
    wrong = len(found) - len(EQUIVALENT)
    score = 1.0 - len(survivors - set(EQUIVALENT)) / wrong
    assert score >= ENOUGH, survivors
    text = " ".join(PAGE.read_text(encoding="utf-8").split())
    assert f"{wrong - len(survivors - set(EQUIVALENT))} of {wrong} wrongs" in text, (score, survivors)
    assert f"{len(EQUIVALENT)} more" in text


STEPS = ("moved", "observed", "joint_loads", "along", "own", "solved", "parted", "seen_at")
"""The methods of the small adapter's model whose results are rounded: all that it computes passes through them."""
POINTWISE_CLAUSES = [*PINNED, "spinning-wheel-needs-a-gyroscopic-torque", "a-run-begins-at-the-initial-state",
                     "sample-times-do-not-change-the-motion", "velocity-is-the-rate-of-position"]  # fmt: skip
RUNS = ["a-pendulum-swings", "energy-is-kept", "a-thrown-body-flies", "loads-of-a-run-hold-at-every-sample"]


def in_single(found: Any) -> Any:
    """Every number of a result rounded to 32 bits."""
    if isinstance(found, np.ndarray | float):
        return type(found)(np.float32(found)) if isinstance(found, float) else found.astype(np.float32).astype(float)
    if isinstance(found, dict):
        return {name: in_single(each) for name, each in found.items()}
    if isinstance(found, list | tuple):
        return type(found)(map(in_single, found))
    if is_dataclass(found) and not isinstance(found, type):
        return replace(found, **{field.name: in_single(getattr(found, field.name)) for field in fields(found)})
    return found


def rounded(function: Callable[..., Any]) -> Callable[..., Any]:
    return lambda *given: in_single(function(*given))


class Single:
    """The small adapter, or a mutant of it, with all that it computes rounded to 32 bits."""

    name = "single"

    def __init__(self, of: Engine, precision: str) -> None:
        self._of, self.precision, self.version = of, precision, of.version

    def supports(self, scene: Scene) -> Support:
        return self._of.supports(scene)

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        return tuple(Effort("tolerance", value, "DOP853") for value in (1e-5, 1e-6, 1e-7))

    def compile(self, scene: Scene) -> Model:
        model = self._of.compile(scene)
        for name in STEPS:
            setattr(model, name, rounded(getattr(model, name)))
        return model


LONG = "a-thrown-body-flies"  # more than a minute, of small steps in Python


@pytest.mark.parametrize(
    "clause", [pytest.param(each, marks=[pytest.mark.slow] * (each == LONG)) for each in POINTWISE_CLAUSES + RUNS]
)
def test_a_correct_engine_in_single_precision_keeps_the_clause_if_it_says_so(clause: str) -> None:
    found = try_clause(Single(SmallEngine(), "single"), CLAUSES[clause])
    assert (found.status, found.precision) == ("holds", "single"), found


@pytest.mark.parametrize("clause", list(PINNED)[:4])
def test_the_same_engine_fails_as_one_in_double_precision(clause: str) -> None:
    assert try_clause(Single(SmallEngine(), "double"), CLAUSES[clause]).status == "broken"


@pytest.mark.parametrize("clause", [*PINNED, "a-tree-swings"])
def test_what_is_wrong_is_noticed_in_single_precision(clause: str) -> None:
    wrong = mutated(BY_NAME[(PINNED | PINNED_RUNS)[clause]])
    assert try_clause(Single(wrong, "single"), CLAUSES[clause]).status == "broken"


@pytest.mark.slow
def test_single_precision_hides_no_mutant() -> None:
    """Every mutant that is noticed in double precision is noticed in single, by the clauses on snapshots of trees."""
    clauses = [CLAUSES[name] for name in PINNED]
    for mutant in MUTANTS:
        if any(try_clause(mutated(mutant), clause).status == "broken" for clause in clauses):
            wrong = Single(mutated(mutant), "single")
            assert any(try_clause(wrong, clause).status == "broken" for clause in clauses), mutant.name


@pytest.mark.slow
def test_the_small_adapter_keeps_the_whole_contract_in_single_precision() -> None:
    found = [try_clause(Single(SmallEngine(), "single"), clause) for clause in CLAUSES.values()]
    assert {each.clause: each.message for each in found if each.status not in ("holds", "not offered")} == {}
    assert "hold in single precision" in verdict_on(found).text


def test_bounds_in_double_precision_are_as_they_were() -> None:
    assert allowance(POINTWISE) == POINTWISE == 1e-9 and allowance(1e-10) == 1e-10
    assert ROUNDINGS * UNIT_ROUNDOFF["double"] < 2e-13


def test_the_verdict_says_in_which_precision() -> None:
    clause = CLAUSES["gravity-accelerates-along-its-vector"]
    text = verdict_on([try_clause(Single(SmallEngine(), "single"), clause)], chosen=True).text
    assert text == "1 of 1 clauses that were chosen hold in single precision, 0 broken"
    assert "precision" not in verdict_on([try_clause(SmallEngine(), clause)], chosen=True).text


@pytest.mark.parametrize("stated", ["half", "Single", 32, None, ["single"]])
def test_another_precision_is_none(stated: Any) -> None:
    found = try_clause(Single(SmallEngine(), stated), CLAUSES["version-is-text"])
    assert found.status == "broken" and "it is one of double, single" in found.message
