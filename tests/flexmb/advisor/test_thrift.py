"""What advice does not run: beyond the operations that a run may take, dear references, methods that are the same."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from crosscheck.library.find import shipped_cases
from flexmb.advisor import confirm
from flexmb.advisor.advice import advise, prepare
from flexmb.advisor.bench import EXACT as ALGORITHMS
from flexmb.advisor.bench import PREDICTED, Bench
from flexmb.advisor.confirm import AGREED, MOST, Confirmation
from flexmb.advisor.methods import SOME_STEPS, STEPS, RunMethod, ladders, simulated
from flexmb.advisor.models import EXACT, BodyModel, Model, built
from flexmb.advisor.quantity import Quantity, error, measured, scales
from flexmb.integrate.catalogue import INTEGRATORS
from flexmb.scene.files import load_scene
from tests.flexmb.advisor.scenes import LENGTH, loaded, turned

WANTED = (Quantity("marker:tip.position"),)
PLAIN: Model = (("arm", BodyModel("modes", 3, "full")),)


def strains(polynomials: int, pieces: int = 1) -> Model:
    return (("arm", BodyModel("strains", level=EXACT, pieces=pieces, polynomials=polynomials)),)


def bent() -> fm.Scene:
    """An arm that a force across its tip bends by its length."""
    rise = fm.SmoothStep(start_value=0.0, end_value=96.0 / LENGTH**2, start_s=0.0, duration_s=0.5)
    return loaded(rise, (0.0, 1.0, 0.0))


def confirmation(tolerance: float) -> Confirmation:
    return prepare(bent(), tolerance, WANTED, 0.7).confirmation()


@pytest.mark.parametrize("integrator", ["dop853", "radau5", "exponential"])
def test_a_run_ends_at_the_operations_that_it_may_take(integrator: str) -> None:
    """An implicit one at those of its first steps if these take more already."""
    method, bench = RunMethod(integrator, 1e-7), Bench(turned(1.0, 0.6), 0.8, WANTED)
    whole = bench.run(PLAIN, method)
    assert whole.finished and not whole.cut and whole.reached == 1.0
    few = Bench(turned(1.0, 0.6), 0.8, WANTED).run(PLAIN, method, whole.operations / 100.0)
    some = Bench(turned(1.0, 0.6), 0.8, WANTED).run(PLAIN, method, whole.operations / 2.0)
    assert few.cut and some.cut and few.reached < some.reached < 1.0
    assert whole.operations / 4.0 < some.operations < 0.75 * whole.operations
    if INTEGRATORS[integrator].linearises:
        system = bench.system(PLAIN)
        assert not isinstance(system, str)
        first = simulated(system, bench.times, method, SOME_STEPS)
        assert few.evaluations == first.statistics.evaluations
    else:
        assert few.operations < whole.operations / 50.0


def test_a_run_that_was_cut_is_made_again_only_if_it_may_take_more() -> None:
    bench, method = Bench(turned(1.0, 0.6), 0.8, WANTED), RunMethod("dop853", 1e-7)
    first = bench.run(PLAIN, method, 1e6)
    assert first.cut and bench.run(PLAIN, method, 1e6) is first and bench.run(PLAIN, method, 5e5) is first
    whole = bench.run(PLAIN, method)
    assert whole.finished and bench.run(PLAIN, method, 1e6) is whole


def test_equal_steps_that_would_cost_too_much_are_not_begun() -> None:
    bench, method = Bench(turned(1.0, 0.6), 0.8, WANTED), RunMethod("rk4", 1e-4)
    found = bench.run(PLAIN, method, 1e6)
    assert found.cut and not found.finished and found.evaluations == 0
    assert bench.run(PLAIN, method).finished


def test_no_step_is_longer_than_the_interval_of_the_output() -> None:
    """Otherwise several methods are one and the same run, and confirm each other."""
    for ladder in ladders(50.0, 0.5, "articulated", True, 0.02):
        assert len(set(ladder)) == len(ladder)
        steps = [method.value for method in ladder if not method.adaptive]
        assert all(step <= 0.02 for step in steps) and sorted(steps, reverse=True) == steps
    every = {ladder[0].integrator: ladder for ladder in ladders(50.0, 0.5, "articulated", True, 0.02)}
    alpha = every["generalised_alpha"]
    assert alpha[0].value == pytest.approx(0.02) and alpha[1].value == pytest.approx(0.02 * STEPS[1] / STEPS[0])


def test_too_dear_to_be_cheaper_is_not_inadequate_for_good() -> None:
    found = confirmation(1e-2)
    model = strains(3)
    assert model not in found.measured
    assert found.error(model, 1e4) == np.inf and not found.adequate(model, 1e4)
    assert model not in found.measured
    assert found.adequate(model) and found.error(model, 1e4) == found.measured[model] < 1e-2


def test_dear_references_are_left_out_until_they_are_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    fine = confirmation(2e-3)
    assert not fine.may_refine and not fine.refine()
    monkeypatch.setattr(confirm, "DEAR", 0.0)
    monkeypatch.setattr(confirm, "AGREED", 1e-6)
    coarse = confirmation(2e-3)
    first = coarse.reference
    assert coarse.may_refine and first.uncertainty <= MOST * coarse.tolerance
    coarse.error(strains(2))
    assert coarse.refine() and coarse.reference.uncertainty < first.uncertainty and not coarse.measured
    assert not coarse.refine()
    assert AGREED < MOST


def test_where_nothing_is_adequate_the_reference_is_refined(monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted: no model is adequate before."""
    scene, asked = bent(), list[str]()
    honest = Confirmation.refine

    def refine(self: Confirmation) -> bool:
        asked.append(self.reference.name)
        return honest(self)

    monkeypatch.setattr(Confirmation, "refine", refine)
    judged = Confirmation.adequate
    monkeypatch.setattr(
        Confirmation, "adequate", lambda self, model, most=np.inf: judged(self, model, most) and bool(asked)
    )
    monkeypatch.setattr(confirm, "DEAR", 0.0)
    monkeypatch.setattr(confirm, "AGREED", 1e-6)
    advice = advise(scene, 2e-3, WANTED, 0.7)
    assert len(asked) == 1 and advice.accepted and advice.measured <= 2e-3


def test_runs_of_candidates_are_those_of_simulate_without_its_warnings(recwarn: pytest.WarningsRecorder) -> None:
    """A candidate with few points is measured, and not talked of; whoever runs it is told."""
    rise = fm.SmoothStep(start_value=0.0, end_value=1000.0 / LENGTH**2, start_s=0.0, duration_s=0.2)
    system, method = fm.compile(built(loaded(rise, (0.0, 1.0, 0.0)), strains(6))), RunMethod("dop853", 1e-4)
    times = np.linspace(0.0, 0.25, 26)
    candidate = simulated(system, times, method)
    assert not recwarn.list
    with pytest.warns(fm.SceneWarning, match="more than its points can follow"):
        run = fm.simulate(system, 0.25, samples=times, **method.options())
    np.testing.assert_array_equal(candidate.markers["tip"].position, run.markers["tip"].position)
    assert candidate.finished and candidate.message in run.message


@pytest.mark.parametrize(
    "rung",
    [
        BodyModel("rigid"), BodyModel("modes", 4, "ruthless"), BodyModel("segments", pieces=8),
        BodyModel("pieces", level="full", pieces=2), BodyModel("pieces", level="full", pieces=8),
        BodyModel("strains", level=EXACT, pieces=1, polynomials=6),
        BodyModel("strains", level=EXACT, pieces=4, polynomials=3),
    ],
    ids=str,
)  # fmt: skip
def test_the_algorithm_that_is_predicted_to_be_cheap_is_cheap(rung: BodyModel) -> None:
    bench = Bench(turned(1.0, 0.6), 0.8, WANTED)
    model = (("arm", rung),)
    counted = {algorithm: bench.operations(model, algorithm) for algorithm in ALGORITHMS}
    assert set(PREDICTED) == set(ALGORITHMS)
    assert counted[bench.algorithm(model)] <= 1.05 * min(counted.values())


@pytest.mark.slow
def test_the_driven_crank_is_answered_within_tolerance() -> None:
    """Against two halves of six polynomials, which the advice did not see."""
    case = next(case for case in shipped_cases() if case.name == "large_deflection/driven_crank")
    scene, tolerance = load_scene(case.folder / "scene.toml"), 1e-2
    advice = advise(scene, tolerance, None, case.run.duration_s)
    assert advice.accepted and advice.scene is not None and advice.method is not None
    link = BodyModel("modes", 4, "stiffened", static=True)
    halves = BodyModel("strains", level=EXACT, pieces=2, polynomials=6, stretching=True)
    times = np.linspace(0.0, advice.t_end, 2001)
    truth = simulated(fm.compile(built(scene, (("beam", halves), ("link", link)))), times, RunMethod("radau5", 1e-5))
    reference = measured(advice.quantities, truth)
    run = measured(advice.quantities, simulated(fm.compile(advice.scene), times, advice.method))
    assert error(run, reference, scales(advice.quantities, reference)) <= min(tolerance, 1.05 * advice.measured)


def test_a_tolerance_that_is_too_loose_does_not_end_the_search_for_a_method() -> None:
    """Dop853 rejects many steps of the slider-crank at a relative tolerance of 1e-2, and takes more operations than the
    fine run; the next tighter one takes least."""
    case = next(case for case in shipped_cases() if case.name == "closed_chains/slider_crank")
    known = prepare(load_scene(case.folder / "scene.toml"), 1e-2, None, case.run.duration_s).confirmation()
    methods = [RunMethod("dop853", rtol, known.bench.algorithm(())) for rtol in (1e-2, 1e-3, 1e-4)]
    loose, best, _ = (known.bench.run((), method) for method in methods)
    assert loose.operations > known.run(()).operations > best.operations and loose.tighter < loose.operations
    assert known.cheapest_method(()) == methods[1]
