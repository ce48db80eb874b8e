"""What helps where advice is refused, and advice in words."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.advisor import advice as advice_module
from flexmb.advisor.advice import advise, prepare, remedies
from flexmb.advisor.confirm import Confirmation, NoReference, hopeless
from flexmb.advisor.ladder import highest_frequency
from flexmb.advisor.models import EXACT, BodyModel, built
from flexmb.advisor.quantity import quantities
from tests.benchmarks.advice_questions import questions
from tests.flexmb.advisor.scenes import turned

ASKED = {question.name: question for question in questions()}


def of(scene: fm.Scene, word: str = "marker:*.position", needs: float = np.inf, reached: float = np.inf) -> str:
    return "; ".join(remedies(scene, quantities(word, scene), 1e-2, 1.0, needs, reached))


def test_every_refusal_names_what_helps_in_its_scene() -> None:
    released, pulsed = ASKED["arm let go"], ASKED["wheel's pulse"]
    said = of(released.scene, released.quantity)
    assert "start from equilibrium" in said and "damping of strip" in said and "than load:pivot.force" in said
    said = of(pulsed.scene, pulsed.quantity)
    assert "a smoother pulse" in said and "wheels[0]" in said and "start from equilibrium" not in said


def test_nothing_is_advised_that_the_scene_has() -> None:
    scene = turned(1.0, 0.6)
    said = of(scene)
    assert "equilibrium" not in said and "pulse" not in said and "damping of arm" in said
    (arm,) = scene.bodies
    assert isinstance(arm, fm.BeamBody)
    damped = replace(scene, bodies=(replace(arm, modes=replace(arm.modes, viscosity_s=1e-3)),))
    assert "damping" not in of(damped)


def test_budget_and_tolerance_that_would_do_are_named() -> None:
    """No budget where no finer model waits for it."""
    scene = turned(1.0, 0.6)
    assert "budget" not in of(scene) and "such as" not in of(scene)
    said = of(scene, needs=2.43, reached=0.0176)
    assert "a longer budget, of 2.5 in place of 1" in said and "than 0.01, such as 0.02, or a shorter time" in said


@pytest.mark.parametrize("doubt", ["references differ", "none adequate"])
def test_both_ways_to_refuse_have_remedies(monkeypatch: pytest.MonkeyPatch, doubt: str) -> None:
    scene = turned(1.0, 0.6)
    if doubt == "references differ":
        def differ(self: object) -> None:
            raise NoReference("references differ")

        monkeypatch.setattr(advice_module.Prepared, "confirmation", differ)
    else:
        def nothing(ladders: object, known: Confirmation, budget: float) -> None:
            known.error(known.reference.model)

        monkeypatch.setattr(advice_module, "search", nothing)
        monkeypatch.setattr(advice_module, "_none_adequate", lambda *given: "none adequate")
    advice = advise(scene, 1e-2, t_end=0.2)
    assert advice.refusal == doubt and advice.remedies
    words = " ".join(str(advice).split())
    assert words.startswith("turned arm: marker:*.position to 0.01 of its scale, from 0 to 0.2 s. Refused: " + doubt)
    assert all(remedy in words for remedy in advice.remedies)


def test_an_advice_reads_as_a_paragraph() -> None:
    advice = advise(turned(0.5, 0.5), 2e-2, t_end=0.6)
    text = str(advice)
    words = " ".join(text.split())
    assert "Take arm as " in words and str(advice.method) in words and f"{advice.measured:.2g}" in words
    assert "Advice(" not in text and max(map(len, text.splitlines())) <= 100 and "\n\n" not in text


def test_a_rod_that_only_stretches_is_answered() -> None:
    """On d'Alembert's waves of a rod that is let go: pieces converge slowly where strains jump, and cost little."""
    question = ASKED["rod let go"]
    advice = advise(question.scene, question.tolerance, question.quantity, question.t_end)
    assert advice.accepted, advice
    assert advice.reference.startswith("64 pieces") and "curvature" not in str(advice.bodies[0].rung)
    times = np.linspace(0.0, question.t_end, 2001)
    truth = question.truth(times)[0]
    assert advice.scene is not None and advice.method is not None
    tip = fm.simulate(advice.scene, question.t_end, samples=2001, **advice.method.options()).markers["tip"].position
    off = np.linalg.norm(tip - truth, axis=1).max() / np.linalg.norm(truth - truth[0], axis=1).max()
    assert off <= advice.measured <= question.tolerance


def test_a_budget_is_named_where_references_wait_for_it() -> None:
    """The one that is said lets the next finer one run."""
    question = ASKED["rod let go"]
    asked = prepare(question.scene, question.tolerance, question.quantity, question.t_end, 5e-3)
    with pytest.raises(NoReference, match="64 pieces: would cost too much") as refused:
        asked.confirmation()
    assert refused.value.beyond == pytest.approx(3.6e8, rel=0.05) and refused.value.reached > 0.5 * asked.tolerance
    budget = refused.value.beyond / advice_module.REFERENCE
    asked = prepare(question.scene, question.tolerance, question.quantity, question.t_end, 1.01 * budget)
    assert asked.confirmation().reference.name == "64 pieces"


def test_damping_that_is_advised_helps() -> None:
    """Modes that creep set the steps of dop853: references of the damped arm are run by Radau 5."""
    question = ASKED["arm let go"]
    (arm,) = question.scene.bodies
    assert isinstance(arm, fm.BeamBody)
    damped = replace(arm, modes=replace(arm.modes, viscosity_s=1e-2))
    scene = replace(question.scene, bodies=(damped,))
    pieces = (("strip", BodyModel("pieces", 0, "stiffened", pieces=8)),)
    swings, creeps = (highest_frequency(each, pieces) for each in (question.scene, scene))
    assert creeps == pytest.approx(1e-2 * swings**2, rel=1e-3)
    advice = advise(scene, question.tolerance, question.quantity, question.t_end)
    assert advice.accepted and advice.reference.startswith("8 pieces"), advice


def test_warnings_are_of_the_scene_not_of_candidates(recwarn: pytest.WarningsRecorder) -> None:
    """Of a quarter of a circle, rungs of few polynomials would warn."""
    question = ASKED["quarter bow"]
    asked = prepare(question.scene, question.tolerance, question.quantity, question.t_end)
    few = built(question.scene, (("strip", BodyModel("strains", level=EXACT, pieces=1, polynomials=1)),))
    with pytest.warns(fm.SceneWarning, match="make it too stiff"):
        fm.compile(few)
    assert asked.ladders["strip"]
    recwarn.clear()
    advise(question.scene, 5e-2, question.quantity, 0.1)
    assert not recwarn.list


def test_references_that_cannot_suffice_are_not_run() -> None:
    """If differences that halve fell to a quarter next, a third of the next one would be left."""
    assert hopeless([0.08, 0.04], 1, 0.0033) and not hopeless([0.08, 0.04], 1, 0.0034)
    assert not hopeless([0.08, 0.04], 3, 0.0033) and hopeless([0.08, 0.08], 3, 0.07)
    assert not hopeless([0.08], 1, 0.0) and not hopeless([0.0, 0.04], 1, 0.0)
