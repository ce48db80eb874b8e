"""The adjoint of whole runs against forward sensitivities, and against differences of runs."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from flexmb.parameters.numbers import Number
from flexmb.ready import scenes
from flexmb.sensitivity.adjoint import stages, whole
from tests.flexmb.sensitivity.test_sensitivities import EVENTS, NUMBERS, arm

# Both take the same equal steps; rounding errors of some hundred steps are left.
SAME_STEPS = 1e-11
# Derivatives of runs whose steps differ: both are exact to some ten times rtol, 1e-10.
OTHER_STEPS = 1e-8
CHANNELS = ["elbow.rotation", "elbow.rotation.rate", "tip.position.x", "tip.quaternion.y", "pivot.force.z", "work", "energy.total"]


def disagreement(scene, t_end, by, channels, **settings):
    """The largest distance of the gradients of final values from forward sensitivities, relative to each gradient."""
    other = fm.sensitivities(scene, t_end, by, channels, samples=2, **settings)
    worst = 0.0
    for k, channel in enumerate(channels):
        found = fm.gradient(scene, t_end, by, fm.FinalValue(channel), **settings)
        assert found.value == pytest.approx(other.values[-1, k], rel=1e-9, abs=1e-12)
        size = np.max(np.abs(other.derivatives[-1, k]))
        off = np.max(np.abs(found.derivatives - other.derivatives[-1, k]))
        worst = max(worst, off / size if size > 0.0 else off)
    return worst


def test_equal_steps_have_one_derivative():
    assert disagreement(arm().scene(), 1.5, NUMBERS, CHANNELS, method="rk4", step=1e-2) < SAME_STEPS


def test_steps_that_adapt_agree_with_forward_sensitivities():
    assert disagreement(arm().scene(), 1.5, NUMBERS, CHANNELS) < OTHER_STEPS


@pytest.mark.parametrize("kind", EVENTS)
def test_events_agree_with_forward_sensitivities(kind):
    scene = arm().event("stop", "elbow.rotation", 0.1, *EVENTS[kind]).scene()
    by = [*NUMBERS, "stop.level", "pivot.rotation.stiffness_Nm_rad"]
    by += ["events.stop.actions.0.restitution"] if kind == "impact" else []
    assert disagreement(scene, 0.9, by, CHANNELS) < OTHER_STEPS


def released() -> fm.SceneBuilder:
    """Latched, released, and then with a stiffer spring."""
    return (
        arm()
        .event("stop", "elbow.rotation", 0.1, fm.Latch(coordinate="elbow.rotation"))
        .event("go", "time", 0.8, fm.Release(coordinate="elbow.rotation"))
        .event("stiffer", "time", 1.1, fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=30.0))
    )


MOVING = ["rod.mass_kg", "stop.level", "go.level", "stiffer.level", "pivot.rotation.stiffness_Nm_rad"]


def test_a_release_and_events_on_time_agree_with_forward_sensitivities():
    assert disagreement(released().scene(), 1.5, MOVING, CHANNELS) < OTHER_STEPS


def test_a_misfit_is_that_of_the_residuals():
    scene, channels, sigma = released().scene(), ["elbow.rotation", "tip.velocity.x"], np.array([0.1, 0.3])
    other = fm.sensitivities(scene, 1.5, MOVING, channels, samples=31)
    measured = other.values + 0.1 * np.sin(9.0 * other.t)[:, None]
    measured[4, 0] = np.nan
    data = {"t": other.t} | dict(zip(channels, measured.T, strict=True))
    found = fm.gradient(scene, 1.5, MOVING, fm.Misfit(data, sigma=dict(zip(channels, sigma.tolist(), strict=True))))
    residuals = np.nan_to_num((other.values - measured) / sigma)
    exact = 2.0 * np.einsum("tk,tkp->p", residuals / sigma, other.derivatives)
    assert found.value == pytest.approx(np.sum(residuals**2), rel=1e-8)
    assert np.max(np.abs(found.derivatives - exact)) < OTHER_STEPS * np.max(np.abs(exact))


@pytest.mark.parametrize("kind", ["impact", "latch", "change"])
def test_the_integral_of_a_rate_is_the_change_of_its_coordinate(kind):
    """Also through an event, at which the rate jumps and which moves with the parameters."""
    scene, by = arm().event("stop", "elbow.rotation", 0.1, *EVENTS[kind]).scene(), [*NUMBERS, "stop.level"]
    found = fm.gradient(scene, 0.9, by, fm.TimeIntegral("elbow.rotation.rate"))
    other = fm.sensitivities(scene, 0.9, by, ["elbow.rotation"], samples=2)
    exact = other.derivatives[-1, 0] - other.derivatives[0, 0]
    assert found.value == pytest.approx(other.values[-1, 0] - other.values[0, 0], abs=1e-9)
    assert np.max(np.abs(found.derivatives - exact)) < OTHER_STEPS


def test_an_integral_of_squares_agrees_with_differences():
    scene = arm().event("stop", "elbow.rotation", 0.1, *EVENTS["impact"]).scene()
    of = [fm.TimeIntegral("elbow.rotation.rate", squared=True, level=0.2, weight=0.5), fm.FinalValue("work", weight=-2.0)]
    by = ["rod.mass_kg", "stop.level"]
    found = fm.gradient(scene, 0.9, by, of)

    def difference(name: str, h: float) -> float:
        value = Number(scene, name).value
        ahead, behind = (
            fm.gradient(scene.with_values({name: value + side * h}), 0.9, ["rod.mass_kg"], of, rtol=1e-12, atol=1e-13)
            for side in (1.0, -1.0)
        )
        return (ahead.value - behind.value) / (2.0 * h)

    for name in by:
        h = 1e-3 * Number(scene, name).value
        exact = (4.0 * difference(name, 0.5 * h) - difference(name, h)) / 3.0
        assert found.derivative(name) == pytest.approx(exact, rel=1e-7)


def test_few_kept_states_give_the_same_gradient(monkeypatch):
    """Memory for a few stages and states: parts of the run are repeated from states that lie many steps apart."""
    from flexmb.sensitivity.adjoint import arc

    scene, of = arm().scene(), [fm.FinalValue("elbow.rotation"), fm.TimeIntegral("tip.position.x", panels=7)]
    whole_run = fm.gradient(scene, 1.5, NUMBERS, of, "rk4", step=1e-2)
    monkeypatch.setattr(arc, "MEMORY", 2000)
    few = fm.gradient(scene, 1.5, NUMBERS, of, "rk4", step=1e-2)
    assert few.checkpoints < whole_run.checkpoints / 10
    assert np.max(np.abs(few.derivatives - whole_run.derivatives)) < 1e-13 * np.max(np.abs(whole_run.derivatives))


def test_flexible_bodies_wheels_and_free_hinges_agree_with_forward_sensitivities():
    scene = scenes.satellite().scene() if hasattr(scenes, "satellite") else scenes.panelled(2, "full").scene()
    by = ["panel.stations.*.EIy_Nm2", "bob.mass_kg"]
    by = [name for name in by if _has(scene, name)]
    channel = [name for names in fm.compile(scene).state_names for name, _ in names][:2]
    assert by and disagreement(scene, 0.3, by, channel) < OTHER_STEPS


def _has(scene, name) -> bool:
    try:
        Number(scene, name)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize("left_out", ["the last stage's weight", "the instant of the event"])
def test_a_planted_fault_is_noticed(monkeypatch, left_out):
    """Negative control of the comparisons."""
    if left_out == "the instant of the event":
        plain = whole.Adjoint._through

        def without(self, part, gradient):
            return plain(self, part._replace(start=np.where(part.start == 1.0, 1.0, 0.0)), gradient)

        monkeypatch.setattr(whole.Adjoint, "_through", without)
        scene = arm().event("stop", "elbow.rotation", 0.1, *EVENTS["impact"]).scene()
        assert disagreement(scene, 0.9, [*NUMBERS, "stop.level"], ["elbow.rotation"]) > 1e-3
        return
    from flexmb.sensitivity.adjoint import arc

    a, node = arc.SCHEMES["rk4"]
    a = a.copy()
    a[4, 3] *= 1.001
    monkeypatch.setitem(arc.SCHEMES, "rk4", arc.Scheme(a, node))
    assert disagreement(arm().scene(), 0.5, NUMBERS, ["elbow.rotation"], method="rk4", step=1e-2) > 1e-6
    assert stages.ADDRESSES > 0
