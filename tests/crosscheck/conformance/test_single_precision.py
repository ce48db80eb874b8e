"""Engines in single precision: held to bounds of their unit roundoff, which notice what is wrong all the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.conformance.clause import POINTWISE, ROUNDINGS, allowance
from crosscheck.conformance.trial import try_clause, verdict_on
from crosscheck.engines.contract import UNIT_ROUNDOFF, Effort, Engine, Model, Support
from flexmb.scene.schema import Scene
from tests.crosscheck.conformance.mutants import MUTANTS, mutated
from tests.crosscheck.conformance.small_adapter import SmallEngine
from tests.crosscheck.conformance.test_mutants import BY_NAME, PINNED, PINNED_RUNS

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
        return replace(found, **{each.name: in_single(getattr(found, each.name)) for each in fields(found)})
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
