"""The clauses of the contract can fail: bad engines break those of form, planted faults those of mechanics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from crosscheck.conformance.catalogue import CLAUSES
from crosscheck.conformance.form import FORM
from crosscheck.conformance.trial import ClauseOutcome, try_clause, verdict_on
from crosscheck.engines.contract import Engine, Model, Run, Snapshot, Support, Trajectory
from crosscheck.engines.registry import engine
from flexmb.scene.schema import Scene
from tests.crosscheck.engines.bad_engines import ANSWERS
from tests.crosscheck.fake_engines import Absent, Fake, Refuser


def outcomes_of(tried: Engine, names: Any = tuple(CLAUSES)) -> dict[str, ClauseOutcome]:
    return {name: try_clause(tried, CLAUSES[name]) for name in names}


def broken(outcomes: dict[str, ClauseOutcome]) -> set[str]:
    return {name for name, outcome in outcomes.items() if outcome.status == "broken"}


FORMAL = [clause.name for clause in FORM.clauses]


def test_a_sound_engine_keeps_every_clause_of_form() -> None:
    assert {outcome.status for outcome in outcomes_of(Fake("fine"), FORMAL).values()} == {"holds"}


@pytest.mark.parametrize("name", ANSWERS)
def test_every_bad_answer_breaks_a_clause_of_form(name: str) -> None:
    """With the reason that a run of a case would give, or with what the clause says of it."""
    found = outcomes_of(ANSWERS[name].make(), FORMAL)
    assert broken(found), found
    assert all(found[clause].message for clause in broken(found))


def test_an_engine_without_its_library_keeps_nothing() -> None:
    kept, text = verdict_on(list(outcomes_of(Absent("absent"), FORMAL).values()))
    assert (kept, "install the extra `absent`" in text) == (False, True), text


def test_an_engine_that_refuses_everything_has_shown_nothing() -> None:
    kept, text = verdict_on(list(outcomes_of(Refuser("refuser")).values()))
    assert (kept, "refuses every scene" in text) == (False, True), text


def test_a_refusal_without_a_reason_is_noticed() -> None:
    class Silent(Fake):
        def supports(self, scene: Scene) -> Support:
            return Support("no")

    assert "a-refusal-has-a-reason" in broken(outcomes_of(Silent("silent"), FORMAL))


Change = Callable[[Any], Any]


class Falsified:
    """The native engine, with its snapshots and its runs changed."""

    name = "falsified"

    def __init__(self, snapshot: Change = lambda found: found, run: Change = lambda found: found) -> None:
        self._native, self._snapshot, self._run = engine("native"), snapshot, run
        self.version, self.supports, self.efforts = self._native.version, self._native.supports, self._native.efforts

    def compile(self, scene: Scene) -> Model:
        return FalsifiedModel(self._native.compile(scene), self._snapshot, self._run)


class FalsifiedModel:
    def __init__(self, model: Model, snapshot: Change, run: Change) -> None:
        self._model, self._snapshot, self._run, self.warm_up = model, snapshot, run, model.warm_up

    def evaluate(self) -> Snapshot:
        return self._snapshot(self._model.evaluate())

    def simulate(self, run: Run, effort: Any) -> Trajectory:
        return self._run(self._model.simulate(run, effort))


def markers(**change: Change) -> Change:
    """Parts of every marker changed."""

    def changed(found: Snapshot) -> Snapshot:
        made = {
            name: replace(marker, **{part: function(getattr(marker, part)) for part, function in change.items()})
            for name, marker in found.markers.items()
        }
        return replace(found, markers=made)

    return changed


def each(name: str, change: Change) -> Change:
    """Every item of an output changed."""
    return lambda found: replace(found, **{name: {key: change(value) for key, value in getattr(found, name).items()}})


def swapped(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values[3:], values[:3]])


FAULTS = {
    "loads on the inboard body": (each("loads", np.negative), {}, "a-hanging-mass-is-held-up"),
    "loads with the force first": (each("loads", swapped), {}, "a-hanging-mass-is-held-up"),
    "loads about the mass centre": (
        each("loads", lambda load: load - np.concatenate([np.cross([1.0, 0, 0], load[3:]), np.zeros(3)])), {},
        "loads-are-about-the-outboard-hinge-point",
    ),
    "quaternions that map World to body": (
        markers(quaternion=lambda q: q * [1, -1, -1, -1]), {}, "quaternions-are-scalar-first"
    ),
    "quaternions with the scalar last": (
        markers(quaternion=lambda q: np.roll(q, -1)), {}, "quaternions-are-scalar-first"
    ),
    "velocities with the linear part first": (
        markers(velocity=swapped), {}, "free-velocities-are-in-outboard-axes"
    ),
    "proper accelerations": (
        markers(acceleration=lambda a: a + np.array([0, 0, 0, 0, 0, 9.81])), {}, "gravity-accelerates-along-its-vector"
    ),
    "momentum about another point": (
        lambda found: replace(found, momentum=found.momentum + [0.1, 0, 0, 0, 0, 0]), {},
        "momentum-is-about-the-world-origin",
    ),
    "drive loads with the other sign": (
        each("drives", np.negative), {}, "prescribed-hinge-reports-its-drive-load"
    ),
    "wheel loads on the body": (
        each("wheel_loads", np.negative), {}, "spinning-wheel-needs-a-gyroscopic-torque"
    ),
    "work done by the arm": (lambda found: found, lambda run: replace(run, work=-run.work), "work-balances-energy"),
    "energy without its springs": (
        lambda found: found, lambda run: replace(run, energy=run.energy | {"spring": 0.0 * run.energy["spring"]}),
        "energy-is-kept",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_breaks_its_clause(fault: str) -> None:
    snapshot, run, clause = FAULTS[fault]
    wrong = Falsified(snapshot, run or (lambda found: found))
    assert try_clause(wrong, CLAUSES[clause]).status == "broken"
    assert try_clause(Falsified(), CLAUSES[clause]).status == "holds"


def test_what_is_broken_says_which_numbers_came() -> None:
    wrong = Falsified(each("loads", np.negative))
    message = try_clause(wrong, CLAUSES["a-hanging-mass-is-held-up"]).message
    assert "must be [ 0.    0.    0.    0.    0.   19.62]" in message, message
