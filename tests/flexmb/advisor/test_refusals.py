"""What helps where advice is refused, and advice in words."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.advisor import advice as advice_module
from flexmb.advisor.advice import advise
from flexmb.advisor.confirm import NoReference, hopeless
from flexmb.advisor.quantity import quantities
from flexmb.advisor.remedies import remedies
from tests.benchmarks.advice_questions import questions
from tests.flexmb.advisor.scenes import turned

ASKED = {question.name: question for question in questions()}


def of(scene: fm.Scene, word: str = "marker:*.position") -> str:
    return "; ".join(remedies(scene, quantities(word, scene), 1e-2, 1.0))


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
    assert "damping" not in of(damped) and "a longer budget, of 2 or more in place of 1" in of(damped)


@pytest.mark.parametrize("doubt", ["references differ", "none adequate"])
def test_both_ways_to_refuse_have_remedies(monkeypatch: pytest.MonkeyPatch, doubt: str) -> None:
    scene = turned(1.0, 0.6)
    if doubt == "references differ":
        def differ(self: object) -> None:
            raise NoReference("references differ")

        monkeypatch.setattr(advice_module.Prepared, "confirmation", differ)
    else:
        monkeypatch.setattr(advice_module, "search", lambda *given: None)
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
    """On d'Alembert's waves of a rod that a smooth force pulls; its first reference was 'no curvature among axial'."""
    rod = ASKED["rod let go"].scene
    pull = fm.SmoothStep(start_value=0.0, end_value=6.0, start_s=0.0, duration_s=0.3)
    load = fm.Load(name="pull", body="strip", node="tip", type="force", direction=(1.0, 0.0, 0.0), function=pull)
    scene = replace(rod, gravity_m_s2=(0.0, 0.0, 0.0), loads=(load,))
    advice = advise(scene, 1e-2, t_end=0.3)
    assert advice.accepted, advice
    assert "curvature" not in advice.reference and "curvature" not in str(advice.bodies[0].rung)


def test_references_that_cannot_suffice_are_not_run() -> None:
    """If differences that halve fell to a quarter next, a third of the next one would be left."""
    assert hopeless([0.08, 0.04], 1, 0.0033) and not hopeless([0.08, 0.04], 1, 0.0034)
    assert not hopeless([0.08, 0.04], 3, 0.0033) and hopeless([0.08, 0.08], 3, 0.07)
    assert not hopeless([0.08], 1, 0.0) and not hopeless([0.0, 0.04], 1, 0.0)
