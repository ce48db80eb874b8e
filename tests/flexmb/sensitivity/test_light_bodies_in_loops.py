"""Loops with a body that is light beside the others: their nearly cancelling loads are refined, and derivatives of what
these loads do must be of all of the load, not of what the refinement adds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.schema import Scene
from tests.flexmb.closure.loops import LIGHT, RATIOS, light_loops, lighter
from tests.flexmb.entry.test_tangent import extrapolated
from tests.flexmb.sensitivity.differences import TIGHT, differences, relative_error, rounding

ROOT = Path(__file__).parents[3]
NUMBER, OUTPUT = "crank.com_m.0", "drive.rotation.rate"


def four_bar(ratio: float) -> Scene:
    """The four-bar of the library, with mass and inertia of its coupler times `ratio`."""
    return lighter(fm.load_scene(ROOT / "cases" / "closed_chains" / "four_bar" / "scene.toml"), ("coupler",), ratio)


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")  # of the runs with other numbers
@pytest.mark.parametrize("ratio", RATIOS)
def test_runs_agree_with_differences(ratio):
    scene = four_bar(ratio)
    found = fm.sensitivities(scene, 0.2, [NUMBER], [OUTPUT], samples=3, rtol=1e-11, atol=1e-13)
    expected = differences(scene, 0.2, NUMBER, [OUTPUT], 1e-3, samples=3)
    assert np.max(expected.error) < 1e-6 * np.max(np.abs(expected.outputs)), "differences tell a millionth"
    assert relative_error(found, NUMBER, expected)[0] < 3e-6
    gradient = fm.gradient(scene, 0.2, [NUMBER], fm.FinalValue(OUTPUT), rtol=1e-11, atol=1e-13).derivatives[0]
    assert gradient == pytest.approx(found.derivatives[-1, 0, 0], rel=1e-7)


@pytest.mark.parametrize("ratio", RATIOS)
def test_accelerations_at_a_state_agree_with_differences(ratio):
    """Under loads that are held, and by the evaluator's recursion, along a speed that the closures allow."""
    system = fm.compile(four_bar(ratio))
    state = system.admissible(system.initial_state)
    d = system.acceleration_derivatives(state)
    evaluator = system.derivative_evaluator()
    along = state.u / np.linalg.norm(state.u)

    def faster(h):
        return np.asarray(system.accelerations(system.state(state.q, state.u + h * along, state.t)))

    expected, doubt = extrapolated(faster, 1e-2)
    size = float(np.max(np.abs(d.by_speed)))
    allowed = 30.0 * float(np.max(doubt)) + 1e-9 * size
    np.testing.assert_allclose(d.by_speed @ along, expected, rtol=0.0, atol=allowed)
    evaluator(state.t, state.q, state.u)
    np.testing.assert_allclose(evaluator.by_speed @ along, expected, rtol=0.0, atol=allowed)
    assert np.max(np.abs(expected)) > 10.0 * allowed, "a slope of nothing would be noticed"


SLOW = ((29, 1e-4), (29, 1e-6), (72, 1e-6))
"""Runs of seed 29 round by 2e-12 of a rate of 1.4 at any tolerance, ten times those of the others."""
IN_ROMBERG = 4.1
"""Of the runs' rounding over the step, in (64 d2 - 20 d1 + d0) / 45, the last entry of Romberg's table."""


@pytest.mark.filterwarnings("ignore::flexmb.SceneWarning")  # of what random scenes are like
@pytest.mark.parametrize(
    ("seed", "ratio"), [(44, 1e-6), *(pytest.param(*each, marks=pytest.mark.slow) for each in SLOW)]
)
def test_a_run_of_a_random_loop_agrees_with_differences(seed, ratio):
    """By the place of the light body's mass, and by gravity, of all rates."""
    scene = light_loops(seed, ratio)
    by, step = [f"bodies.{LIGHT[seed]}.com_m.0", "gravity_m_s2.0"], 1e-2
    system = fm.compile(scene)
    known = {name for name, _, _ in fm.simulate(system, 1e-4, samples=2).columns()}
    of = [name for name, _ in system.state_names[1] if name in known][:8]
    found = fm.sensitivities(scene, 0.02, by, of, samples=2, rtol=1e-11, atol=1e-13)
    size = np.max(np.abs(found.derivatives[-1]))
    for k, name in enumerate(by):
        expected = differences(scene, 0.02, name, of, step, samples=2)
        noise = rounding(scene, 0.02, {name: 1e-4 * step}, of, expected.outputs[-1][:, None], **TIGHT)
        allowed = 3.0 * expected.error[-1] + 4.0 * IN_ROMBERG * noise / step + 1e-8 * size
        off = np.abs(found.derivatives[-1, :, k] - expected.outputs[-1])
        assert np.all(off < allowed)
        assert np.max(np.abs(expected.outputs[-1]) - 100.0 * allowed) > 0.0, "a wrong sign would be noticed"
    of_last = int(np.argmax(np.abs(found.derivatives[-1, :, 0])))
    gradient = fm.gradient(scene, 0.02, by, fm.FinalValue(of[of_last]), rtol=1e-11, atol=1e-13).derivatives
    np.testing.assert_allclose(gradient, found.derivatives[-1, of_last], rtol=0.0, atol=1e-7 * size)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::flexmb.SceneWarning")
def test_derivatives_that_round_by_more_than_the_tolerance_are_refused_and_the_remedy_helps():
    scene = light_loops(72, 1e-8)
    by, of = [f"bodies.{LIGHT[72]}.com_m.0", "gravity_m_s2.0"], ["w0.speed", "h2.translation.rate"]
    with pytest.raises(fm.DynamicsError, match="round by more than the tolerances, atol = 1e-13.*a larger rtol and at"):
        fm.sensitivities(scene, 0.02, by, of, samples=2, rtol=1e-11, atol=1e-13)
    tolerances = [{"rtol": each, "atol": 1e-2 * each} for each in (1e-8, 1e-9)]
    looser = [fm.sensitivities(scene, 0.02, by, of, samples=2, **tolerance).derivatives for tolerance in tolerances]
    size = np.max(np.abs(looser[1][-1]), axis=0)
    assert np.all(np.abs(looser[0] - looser[1])[-1] < 1e-5 * size)
