"""Nothing much cheaper would do, by brute force; the order of bodies decides nothing; what cannot move is refused."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from msgspec.structs import replace

import flexmb as fm
from flexmb.advisor.advice import Advice, advise, prepare
from flexmb.advisor.modal_response import rigid_run
from flexmb.advisor.models import BodyModel, built
from flexmb.advisor.quantity import Quantity, error, measured, scales
from flexmb.entry.articulated import accelerations
from flexmb.jit.counting import count
from flexmb.scene import schema as s
from flexmb.tables.state import pack
from tests.flexmb.advisor.scenes import stiff_and_soft, turned
from tests.flexmb.closure import mechanisms

WANTED = (Quantity("marker:tip.position"),)
RUNGS = (
    BodyModel("rigid"), BodyModel("sprung"),
    *(BodyModel("modes", n, level) for n in (1, 2, 4) for level in ("ruthless", "full", "stiffened")),
    BodyModel("segments", pieces=2), BodyModel("segments", pieces=4), BodyModel("pieces", 0, "stiffened", pieces=2),
)  # fmt: skip
METHODS = (
    [{"method": "dop853", "rtol": rtol, "atol": 1e-2 * rtol} for rtol in (1e-2, 1e-3, 1e-4)],
    [{"method": "rk4", "step": 0.1 / 2**n} for n in range(8)],
)


def brute_force(scene: fm.Scene, t_end: float, tolerance: float) -> float:
    """Operations of the cheapest run within the tolerance, of every rung above by every method, where the next tighter
    method keeps it too; against four pieces with an eigenmode each."""
    finest = (("arm", BodyModel("pieces", 1, "stiffened", pieces=4)),)
    fine = fm.simulate(built(scene, finest), t_end, rtol=1e-8, atol=1e-10)
    reference = measured(WANTED, fine)
    scale, least = scales(WANTED, reference), np.inf
    for rung in RUNGS:
        system = fm.compile(built(scene, (("arm", rung),)))
        y = pack(system.initial_state)
        each = count(accelerations, 0.0, y, system.recursion_constants, system.recursion_workspace()).operations.total
        for ladder in METHODS:
            runs = [fm.simulate(system, t_end, **method) for method in ladder]
            fits = [run.finished and error(measured(WANTED, run), reference, scale) <= tolerance for run in runs]
            for (run, fit), (_, next_fits) in pairwise(zip(runs, fits, strict=True)):
                if fit and next_fits:
                    least = min(least, each * run.statistics.evaluations)
    return least


@pytest.mark.parametrize("tolerance", [2e-2, 2e-3])
def test_nothing_costs_less_than_half_of_what_is_advised(tolerance: float) -> None:
    scene = turned(1.0, 0.6)
    advice = advise(scene, tolerance, WANTED, 0.8)
    cheapest = brute_force(scene, 0.8, tolerance)
    assert advice.accepted and np.isfinite(cheapest)
    assert advice.operations <= 2.0 * cheapest
    dearest = max(trial.operations for trial in advice.trials)
    assert dearest > 2.0 * cheapest  # not everything is as cheap as that


def answer(advice: Advice) -> tuple[dict[str, BodyModel], object, int]:
    return {body.body: body.rung for body in advice.bodies}, advice.method, advice.evaluations


def test_the_order_of_bodies_changes_nothing() -> None:
    """Bodies, hinges and markers listed backwards: the same scene, the same advice."""
    scene = stiff_and_soft(1.0, 0.8)
    backwards = replace(scene, bodies=scene.bodies[::-1], hinges=scene.hinges[::-1], markers=scene.markers[::-1])
    one, two = (advise(each, 5e-3, t_end=1.0) for each in (scene, backwards))
    assert one.accepted and answer(one) == answer(two)
    assert one.measured == pytest.approx(two.measured, rel=1e-6)
    assert len(one.trials) == len(two.trials)


@pytest.mark.parametrize("drive", [None, s.Ramp(value=0.5 * np.pi, rate=0.6)], ids=["free", "driven"])
def test_a_mechanism_that_is_locked_is_refused_with_the_reason(drive: s.Function | None) -> None:
    scene = mechanisms.tilted_four_bar(flexible=False, drive=drive)
    advice = advise(scene, 1e-2, "energy.total@1", t_end=0.1)
    assert not advice.accepted and advice.scene is None
    assert "closure" in advice.refusal and '"c"' in advice.refusal and "the mechanism is locked" in advice.refusal


def test_what_locks_without_flexibility_has_no_rigid_run_and_that_is_said() -> None:
    scene = mechanisms.tilted_four_bar(flexible=True, drive=s.Ramp(value=0.5 * np.pi, rate=0.6))
    found = rigid_run(scene, np.linspace(0.0, 0.1, 11))
    assert isinstance(found, str) and found.startswith("all bodies rigid") and "locked" in found


@pytest.mark.parametrize("tolerance", [0.5, 1e-2, 1e-4])
def test_references_are_integrated_more_tightly_once(tolerance: float) -> None:
    """What that changes is known, not zero, at loose tolerances too."""
    confirmation = prepare(turned(1.0, 0.6), tolerance, WANTED, 0.8).confirmation()
    assert 0.0 < confirmation.drift <= 0.1 * tolerance
    assert confirmation.reference.uncertainty >= confirmation.drift
