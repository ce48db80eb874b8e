"""Advice end to end: right where the answer is known, refused where nothing is adequate, safe from lying indicators."""

from __future__ import annotations

from dataclasses import replace as changed

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.advisor import advice as advice_module
from flexmb.advisor.advice import Advice, advise
from flexmb.advisor.bench import Bench
from flexmb.advisor.methods import RunMethod
from flexmb.advisor.models import BodyModel, built
from flexmb.advisor.quantity import error, measured, quantities, scales
from flexmb.surrogate import modal_points, substructured
from tests.flexmb.advisor.scenes import spun, stiff_and_soft, turned

T_END = 0.8


def true_error(advice: Advice, scene: fm.Scene) -> float:
    """Error of the advised run over a finer output, against four pieces of more modes, integrated more finely."""
    wanted, times = advice.quantities, np.linspace(0.0, advice.t_end, 1201)
    fine = substructured(scene, "arm", 4, level="stiffened", eigenmodes=1)
    reference = measured(wanted, fm.simulate(fine, advice.t_end, rtol=1e-9, atol=1e-11, samples=times))
    assert advice.scene is not None and advice.method is not None
    run = fm.simulate(advice.scene, advice.t_end, samples=times, **advice.method.options())
    return error(measured(wanted, run), reference, scales(wanted, reference))


def rung(advice: Advice) -> BodyModel:
    assert advice.accepted, advice.refusal
    return advice.bodies[0].rung


@pytest.fixture(scope="module")
def gentle() -> tuple[fm.Scene, Advice]:
    scene = turned(1.0, 0.6)
    return scene, advise(scene, 5e-3, t_end=T_END)


def test_rigid_is_enough_for_an_arm_that_hardly_bends() -> None:
    scene = turned(0.5, 4.0)
    advice = advise(scene, 1e-2, t_end=5.0)
    assert rung(advice) == BodyModel("rigid")
    assert true_error(advice, scene) <= advice.tolerance


def test_rigid_is_not_enough_for_an_arm_that_bends(gentle: tuple[fm.Scene, Advice]) -> None:
    scene, advice = gentle
    assert rung(advice) != BodyModel("rigid")
    rigid = next(trial for trial in advice.trials if trial.model == (("arm", BodyModel("rigid")),))
    assert rigid.measured > advice.tolerance and not rigid.adequate
    assert true_error(advice, scene) <= advice.tolerance


def test_one_mode_is_found_where_one_mode_is_enough(gentle: tuple[fm.Scene, Advice]) -> None:
    scene, advice = gentle
    assert rung(advice).kind == "sprung" or rung(advice).modes == 1
    one = next(t for t in advice.trials if t.model[0][1].kind == "modes" and t.model[0][1].modes == 1)
    assert one.adequate


def test_near_the_critical_speed_only_what_stiffens_is_right() -> None:
    scene = spun(22.0, 1.0)  # first frequency 23.4 rad/s
    advice = advise(scene, 2e-3, "marker:tip.position@0.5", 1.2)
    bench = Bench(scene, 1.2, quantities("marker:tip.position@0.5", scene))
    fine = bench.run((("arm", BodyModel("pieces", 0, "stiffened", pieces=4)),), RunMethod("dop853", 1e-8)).signals
    for level, right in (("full", False), ("stiffened", True)):
        run = bench.run((("arm", BodyModel("modes", 2, level)),), RunMethod("dop853", 1e-8))
        assert (error(run.signals, fine, {"marker:tip.position": 0.5}) <= advice.tolerance) is right, level
    assert rung(advice).level != "full"
    assert true_error(advice, scene) <= advice.tolerance


def test_the_same_question_has_the_same_answer(gentle: tuple[fm.Scene, Advice]) -> None:
    scene, advice = gentle
    again = advise(scene, 5e-3, t_end=T_END)
    assert changed(again, seconds=0.0) == changed(advice, seconds=0.0)


def test_costs_are_counted_operations(gentle: tuple[fm.Scene, Advice]) -> None:
    scene, advice = gentle
    bench = Bench(scene, T_END, advice.quantities)
    model = tuple((body.body, body.rung) for body in advice.bodies)
    outcome = bench.run(model, advice.method)
    assert outcome.operations == advice.operations
    assert outcome.operations == outcome.evaluations * bench.operations(model, advice.method.algorithm)
    cheaper = [t for t in advice.trials if t.adequate]
    assert min(cheaper, key=lambda t: t.operations).operations <= 2.0 * next(
        t.operations for t in advice.trials if t.model == model
    )


@pytest.mark.parametrize("lie", [0.0, 1.0, np.inf])
def test_indicators_that_lie_are_found_out(monkeypatch: pytest.MonkeyPatch, lie: float) -> None:
    """Rigid bent arms are perfect, or nothing is any good: what is advised is right all the same."""
    scene = turned(1.0, 0.6)
    monkeypatch.setattr(advice_module, "predicted", lambda rung, body: lie)
    advice = advise(scene, 5e-3, t_end=T_END)
    assert rung(advice) != BodyModel("rigid")
    assert advice.measured <= advice.tolerance
    assert true_error(advice, scene) <= advice.tolerance


def test_a_better_advice_for_a_single_lie(monkeypatch: pytest.MonkeyPatch, gentle: tuple[fm.Scene, Advice]) -> None:
    """Only the rigid rung is praised: it is run, fails, and the walk goes on."""
    honest = advice_module.predicted
    lying = {"rigid": 0.0}
    monkeypatch.setattr(advice_module, "predicted", lambda rung, body: lying.get(rung.kind, honest(rung, body)))
    scene, truth = gentle
    advice = advise(scene, 5e-3, t_end=T_END)
    assert any(t.model[0][1].kind == "rigid" and not t.adequate and t.predicted == 0.0 for t in advice.trials)
    assert advice.operations <= 2.0 * truth.operations


def test_raw_modes_that_cannot_stiffen_are_refused_where_they_would_have_to() -> None:
    scene = modal_points(spun(22.0, 1.0))
    advice = advise(scene, 1e-3, t_end=1.2)
    assert not advice.accepted and advice.scene is None
    assert "second-order deflection, which none of its models has" in advice.refusal


def test_a_tolerance_beyond_the_finest_models_is_refused() -> None:
    """An arm that starts bent is not taken apart: what more modes and their third order leave open is too much."""
    arm = turned(1.0, 0.6)
    bent = replace(arm, modal_states=(fm.ModalState(body="arm", coordinates=(0.01, 0.0, 0.0)),))
    assert advise(bent, 2e-2, t_end=0.7).accepted
    advice = advise(bent, 1e-4, t_end=0.7)
    assert not advice.accepted
    assert "not known to 0.0001" in advice.refusal
    assert "second-order deflection, which none of its models has" in advice.refusal


def test_rigid_scenes_get_their_method() -> None:
    scene = (
        fm.SceneBuilder("pendulum", gravity=(0.0, 0.0, -9.81))
        .rigid_body("bob", mass=1.0, com=(1.0, 0.0, 0.0), inertia=(0.01, 0.02, 0.02))
        .revolute("pivot", "ground", "bob", axis=(0.0, 1.0, 0.0), angle=1.0)
        .marker("bob", "bob", offset=(1.0, 0.0, 0.0))
        .scene()
    )
    advice = advise(scene, 1e-4, t_end=3.0)
    assert advice.accepted and advice.bodies == () and advice.method is not None
    wanted, times = advice.quantities, np.linspace(0.0, 3.0, 601)
    fine = measured(wanted, fm.simulate(scene, 3.0, samples=times))
    run = measured(wanted, fm.simulate(scene, 3.0, samples=times, **advice.method.options()))
    assert error(run, fine, scales(wanted, fine)) <= 1e-4


def test_what_is_advised_is_what_was_measured(gentle: tuple[fm.Scene, Advice]) -> None:
    scene, advice = gentle
    assert advice.scene == built(scene, tuple((body.body, body.rung) for body in advice.bodies))
    assert advice.uncertainty < advice.measured <= advice.tolerance


def test_bodies_are_chosen_one_by_one() -> None:
    """A stiff arm carries a soft one: only the soft one needs to bend."""
    scene = stiff_and_soft(1.0, 0.8)
    advice = advise(scene, 5e-3, t_end=1.0)
    chosen = {body.body: body.rung for body in advice.bodies}
    assert chosen["arm"] == BodyModel("rigid")
    assert chosen["whip"] != BodyModel("rigid")
    assert advice.measured <= advice.tolerance
