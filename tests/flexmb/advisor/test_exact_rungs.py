"""Rungs and references of level exact: for beams that bend by their length, and only for them."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.advisor.advice import advise, prepare
from flexmb.advisor.ladder import highest_frequency, references, rungs, softest
from flexmb.advisor.models import EXACT, LEVELS, BodyModel, built, levels
from flexmb.modal import flexible_model
from tests.flexmb.advisor.scenes import LENGTH, SECTION, beam, loaded, stiff_and_soft, turned

EI = 12.0
STRAINS = BodyModel("strains", level=EXACT, pieces=1, polynomials=3)


def bent_by_its_length() -> fm.Scene:
    """P L^2 / EI = 8, reached in about two periods of the arm."""
    rise = fm.SmoothStep(start_value=0.0, end_value=8.0 * EI / LENGTH**2, start_s=0.0, duration_s=0.5)
    return loaded(rise, (0.0, 1.0, 0.0))


def test_a_beam_that_bends_by_its_length_is_answered_and_the_answer_holds() -> None:
    scene = bent_by_its_length()
    advice = advise(scene, 2e-3, "marker:tip.position", 0.7)
    assert advice.accepted, advice.refusal
    assert advice.bodies[0].rung.level == "exact"
    assert advice.scene is not None and advice.method is not None
    run = fm.simulate(advice.scene, 0.7, samples=2001, **advice.method.options())
    truth = built(scene, (("arm", BodyModel("strains", level=EXACT, pieces=2, polynomials=7)),))
    fine = fm.simulate(truth, 0.7, samples=2001, method="radau5", rtol=1e-8, atol=1e-10)
    path, reference = (each.markers["tip"].position for each in (run, fine))
    apart = np.linalg.norm(path - reference, axis=1).max() / np.linalg.norm(reference - reference[0], axis=1).max()
    assert apart < 2e-3 and apart <= advice.measured * 1.05


def test_references_for_it_gain_polynomials_and_then_pieces() -> None:
    scene = bent_by_its_length()
    assert [name for name, _ in references(scene, frozenset({"arm"}))] == [
        "4 polynomials", "6 polynomials", "8 polynomials", "2 pieces of 6 polynomials", "4 pieces of 6 polynomials",
        "8 pieces of 6 polynomials",
    ]  # fmt: skip
    assert all(not name.endswith("polynomials") for name, _ in references(scene))
    bent = replace(scene, modal_states=(fm.ModalState(body="arm", coordinates=(0.1, 0.0, 0.0)),))
    assert [name for name, _ in references(bent, frozenset({"arm"}))] == ["modes", "still more modes"]


def test_a_beam_that_hardly_bends_has_no_strains_to_try() -> None:
    ladders = [prepare(turned(0.01, 0.5), tolerance, None, 0.5).ladders["arm"] for tolerance in (1e-2, 1e-9)]
    coarse, fine = ({step.rung.level for step in steps} for steps in ladders)
    assert EXACT not in coarse and EXACT in fine


def test_stretch_and_shear_are_those_of_families_and_theory() -> None:
    scene = turned(1.0, 0.5)
    plain = rungs(scene, scene.bodies[0], frozenset())
    assert not any(rung.stretching for rung in plain)
    stretching = BodyModel("strains", level=EXACT, pieces=1, polynomials=4, stretching=True)
    with pytest.raises(ValueError, match="no stretch or shear"):
        built(scene, (("arm", stretching),))
    modes = fm.Modes(count=3, families=("axial", "bending_y"))
    section = tuple(replace(station, GAy_N=1e6, GAz_N=1e6) for station in scene.bodies[0].stations)
    soft = replace(scene, bodies=(replace(scene.bodies[0], theory="timoshenko", modes=modes, stations=section),))
    assert any(rung.stretching for rung in rungs(soft, soft.bodies[0], frozenset()))
    strains = built(soft, (("arm", stretching),)).bodies[0].modes.polynomials
    assert strains == fm.StrainPolynomials(axial=2, shear_y=2, bending_y=4)


def test_strains_in_place_of_modes_and_modes_in_place_of_strains() -> None:
    """Each has the frequencies of the arm; the tables of the model follow from its name alone."""
    scene = turned(1.0, 0.5)
    first = np.sqrt(flexible_model(scene.bodies[0]).stiffness[0, 0])
    exact = built(scene, (("arm", STRAINS),))
    assert str(STRAINS) == "3 polynomials of each curvature, exact"
    assert np.sqrt(flexible_model(exact.bodies[0]).stiffness[0, 0]) == pytest.approx(first, rel=2e-3)
    assert highest_frequency(scene, (("arm", STRAINS),)) > 3.0 * first
    back = built(exact, (("arm", BodyModel("modes", 3, "full")),)).bodies[0]
    assert back == scene.bodies[0]
    pieces = built(exact, (("arm", BodyModel("pieces", 0, "stiffened", pieces=2)),))
    assert fm.compile(pieces).nu == 1 + 2 * 2


def test_a_beam_curved_at_rest_has_strains_only() -> None:
    section = replace(SECTION, curvature_1_m=(0.0, 0.0, 0.5))
    arm = fm.SceneBuilder("arc", allow=("few_polynomials",)).beam(
        "arm", length=LENGTH, elements=8, section=section, modes=fm.Modes(count=3, families=("bending_y",)),
        level="exact", points="line",
    )  # fmt: skip
    step = fm.SmoothStep(start_value=0.0, end_value=0.4, start_s=0.0, duration_s=0.3)
    scene = arm.revolute("hub", "ground", "arm", prescribed=step).marker("tip", "arm", node="tip").scene()
    assert levels(scene.bodies[0]) == (EXACT,) and levels(turned(1.0, 0.5).bodies[0]) == (*LEVELS, EXACT)
    asked = prepare(scene, 1e-3, None, 0.5)
    kinds = {step.rung.kind for step in asked.ladders["arm"]}
    assert "strains" in kinds and not kinds & {"modes", "segments", "pieces"}
    advice = advise(scene, 1e-2, None, 0.5)
    assert advice.accepted and advice.measured < 1e-2


def test_an_initial_bend_in_strains_is_kept_by_more_polynomials() -> None:
    bent = (0.3, -0.02)
    modes = fm.Modes(count=2, families=("bending_y",))
    base = beam(fm.SceneBuilder("bent")).revolute("pin", "ground", "arm").marker("tip", "arm", node="tip").scene()
    own = replace(base.bodies[0], modes=modes, level="exact")
    scene = replace(base, bodies=(own,), modal_states=(fm.ModalState(body="arm", coordinates=bent),))
    tips = []
    for each in (scene, built(scene, (("arm", BodyModel("strains", level=EXACT, pieces=1, polynomials=5)),))):
        system = fm.compile(each)
        start = system.initial_state
        tips.append(system.evaluate(0.0, start.q, start.u).markers["tip"].position)
    np.testing.assert_allclose(tips[1], tips[0], atol=2e-6 * LENGTH)  # of 6 and 8 points
    with pytest.raises(ValueError, match="starts bent"):
        built(scene, (("arm", BodyModel("modes", 3, "full")),))
    assert [name for name, _ in references(scene)] == ["modes", "still more modes"]
    asked = prepare(scene, 1e-3, None, 0.5)
    assert asked.hidden == 0.0 and '"arm" hold' in asked.notes[0]


def test_a_stiffened_beam_that_starts_bent_is_compared_at_its_own_points() -> None:
    """Equivalent masses at level stiffened are fewer than the points of its eigenmodes."""
    base = beam(fm.SceneBuilder("bent")).weld("pin", "ground", "arm").marker("tip", "arm", node="tip").scene()
    arm = replace(base.bodies[0], level="stiffened")
    scene = replace(base, bodies=(arm,), modal_states=(fm.ModalState(body="arm", coordinates=(1e-3, 0.0, 0.0)),))
    first = prepare(scene, 1e-3, None, 0.5).known["arm"]
    assert first.deflection > 0.0


def test_without_predictions_the_softest_beams_are_taken_to_bend_far() -> None:
    """The whip's tip yields 85 times as much to a force as the arm's."""
    scene = stiff_and_soft(0.5, 0.4)
    assert softest(scene) == {"whip"}
    first = dict(references(scene, softest(scene))[0][1])
    assert first["whip"].kind == "strains" and first["arm"].kind == "modes"
