"""The adjoint of whole runs against forward sensitivities, and against differences of runs."""

from __future__ import annotations

import warnings

import msgspec
import numpy as np
import pytest

import flexmb as fm
import flexmb.sensitivity.gradient as gradient_module
from flexmb.parameters.numbers import Number
from flexmb.ready import scenes
from flexmb.scene import sizes
from flexmb.sensitivity.adjoint import arc, part
from flexmb.sensitivity.adjoint.sampling import SampledLoop
from tests.flexmb.closure import mechanisms
from tests.flexmb.control.scenes import driven_four_bar
from tests.flexmb.sensitivity.differences import TIGHT
from tests.flexmb.sensitivity.test_sensitivities import EVENTS, NUMBERS, arm
from tests.repo.project import ROOT

# Both take the same equal steps; rounding errors of some hundred steps are left.
SAME_STEPS = 1e-11
# Derivatives of runs whose steps differ: both are exact to some ten times rtol, 1e-10.
OTHER_STEPS = 1e-8
CHANNELS = [
    "elbow.rotation", "elbow.rotation.rate", "tip.position.x", "tip.quaternion.y", "pivot.force.z", "work",
    "energy.total",
]  # fmt: skip


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


FOUR_BAR = ROOT / "cases" / "closed_chains" / "four_bar" / "scene.toml"


@pytest.mark.parametrize("hits", [False, True], ids=["smooth", "impact"])
def test_closed_chains_agree_with_forward_sensitivities(hits):
    """By masses, by a length on which the closure depends, and by how the crank starts, without and with an impact."""
    scene = fm.load_scene(FOUR_BAR)
    if hits:
        stop = fm.Impact(coordinate="drive.rotation", restitution=0.5)
        event = fm.SceneEvent(name="hit", watch="drive.rotation", level=1.2, actions=(stop,))
        scene = msgspec.structs.replace(scene, events=(event,))
    by = ["crank.mass_kg", "coupler.com_m.0", "drive.rotation.rate_rad_s", "bodies.rocker.nodes.tip.position_m.0"]
    by += ["hit.level", "events.hit.actions.0.restitution"] if hits else []
    channels = ["drive.rotation", "joint.position.x", "pivot.rotation.rate", "loop.force.x", "work", "energy.total"]
    if not hits:
        assert disagreement(scene, 0.4, by, channels, method="rk4", step=1e-2) < SAME_STEPS
    assert disagreement(scene, 0.4, by, channels) < OTHER_STEPS


def test_couplings_agree_with_forward_sensitivities():
    scene = fm.load_scene(ROOT / "cases" / "closed_chains" / "geared_hoist" / "scene.toml")
    by = [f"bodies.{scene.bodies[0].name}.mass_kg", f"bodies.{scene.bodies[-1].name}.mass_kg"]
    channels = [f"{scene.hinges[0].name}.rotation", "energy.total"]
    assert disagreement(scene, 0.3, by, channels) < OTHER_STEPS


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
    of = [
        fm.TimeIntegral("elbow.rotation.rate", squared=True, level=0.2, weight=0.5), fm.FinalValue("work", weight=-2.0)
    ]  # fmt: skip
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
    scene, of = arm().scene(), [fm.FinalValue("elbow.rotation"), fm.TimeIntegral("tip.position.x", panels=7)]
    whole_run = fm.gradient(scene, 1.5, NUMBERS, of, "rk4", step=1e-2)
    monkeypatch.setattr(arc, "MEMORY", 2000)
    few = fm.gradient(scene, 1.5, NUMBERS, of, "rk4", step=1e-2)
    assert few.checkpoints < whole_run.checkpoints / 10
    assert np.max(np.abs(few.derivatives - whole_run.derivatives)) < 1e-13 * np.max(np.abs(whole_run.derivatives))


@pytest.mark.parametrize("level", ["full", "linear", "stiffened", "ruthless"])
def test_a_beam_agrees_with_forward_sensitivities(level):
    """By stations, on which the modes depend, and by the body that carries it."""
    scene = scenes.panelled(2, level).scene()
    by = ["bob.mass_kg", "bob.com_m.0", "gravity_m_s2.1"]
    if level != "stiffened":  # numbers of tiny influence on its tables have no derivative
        by += ["panel.stations.*.EIy_Nm2", "panel.stations.*.mass_per_length_kg_m"]
    assert disagreement(scene, 0.2, by, ["pivot.rotation", "tip.position.y"], method="rk4", step=2e-4) < 1e-9


CONTROLLED = [
    "bob.mass_kg", "controllers.servo.kp", "servo.ki", "servo.kd", "servo.filter_s", "law.A.0.0", "law.B.0.1",
    "twist.function.gain", "pivot.rotation.stiffness_Nm_rad",
]  # fmt: skip
SIGNALS = ["pivot.rotation", "centre.acceleration.x", "signal.servo[0]", "signal.law[0]", "signal.acc[1]"]


def controlled(**sampling) -> fm.SceneBuilder:
    """A pendulum with a PID controller with a filter, and a law of states that reads an acceleration; both push."""
    builder = scenes.pendulum().sense_marker("place", "centre", "position")
    builder.sense_marker("acc", "centre", "acceleration")
    builder.pid("servo", "place[1]", kp=1.0, ki=1.0, kd=0.5, filter=0.1, **sampling)
    law = {"A": [[-1.0]], "B": [[0.1, 0.2]], "C": [[1.0]], "D": [[0.0, 0.1]]}
    builder.state_space("law", ["acc[0]", "place[0]"], **law, **sampling)
    builder.torque("twist", "bob", direction=(0, 0, 1), function=fm.ControlSignal(source="law", gain=-0.7))
    push = fm.ControlSignal(source="servo", gain=2.0)
    return builder.torque("push", "bob", direction=(0, 0, 1), function=push)


@pytest.mark.parametrize("delay", [0.0, 0.01, 0.07])
def test_sampled_controllers_agree_with_forward_sensitivities(delay):
    """With outputs that wait for less than a period, and for more; at an instant, and between two."""
    scene = controlled(period=0.05, delay=delay).scene()
    assert disagreement(scene, 1.0, CONTROLLED, SIGNALS[:3]) < 1e-10
    assert disagreement(scene, 0.97, CONTROLLED, SIGNALS) < 1e-10
    assert disagreement(scene, 0.97, CONTROLLED, ["work"]) < 1e-10


def test_a_controlled_closed_chain_agrees_with_forward_sensitivities():
    """At an instant, and between two; the loads of closures follow what is driven."""
    scene = driven_four_bar(period_s=0.05, delay_s=0.02)
    by = ["crank.mass_kg", "coupler.com_m.0", "servo.kp", "drive.rotation.torque_Nm.gain"]
    for t_end in (0.3, 0.33):
        assert disagreement(scene, t_end, by, ["drive.rotation", "pivot.rotation.rate"]) < 1e-9


def test_events_between_the_instants_of_controllers():
    """Two impacts and a change of a value, one of them while an output waits."""
    scene = (
        controlled(period=0.05, delay=0.07)
        .event("stop", "pivot.rotation", -0.2, fm.Impact(coordinate="pivot.rotation", restitution=0.6))
        .event("stiff", "time", 0.61, fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=30.0))
        .scene()
    )
    assert disagreement(scene, 0.97, [*CONTROLLED, "stop.level"], SIGNALS) < 1e-10


def test_the_satellite_agrees_with_forward_sensitivities():
    """A free hub with flexible panels, wheels and slosh, a sampled attitude law, and a latch on the way."""
    scene = fm.load_scene(ROOT / "cases" / "spacecraft" / "deploy_and_slew" / "scene.toml")
    by = ["hub.mass_kg", "left_hinge.rotation.stiffness_Nm_rad", "left.stations.*.EIy_Nm2", "attitude.parameters.3"]
    assert disagreement(scene, 3.0, by, ["left_tip.position.x", "tracker.quaternion.x"]) < 1e-6


def test_outputs_that_wait_are_not_forgotten(monkeypatch):
    """Negative control: without them, gradients of runs with delays are wrong."""
    plain = SampledLoop.acted

    def forgetting(self, t, at):
        return plain(self, t, at)._replace(rows={})

    monkeypatch.setattr(SampledLoop, "acted", forgetting)
    assert disagreement(controlled(period=0.05, delay=0.01).scene(), 0.97, CONTROLLED, ["pivot.rotation"]) > 1e-4


@pytest.mark.parametrize("left_out", ["a part of a weight", "the instant of the event"])
def test_a_planted_fault_is_noticed(monkeypatch, left_out):
    """Negative control of the comparisons."""
    if left_out == "the instant of the event":
        plain = part.PassedPart._before

        def without(self, gradient):
            kept = np.where(self.start == 1.0, 1.0, 0.0)
            monkeypatch.setattr(self, "start", kept)
            return plain(self, gradient)

        monkeypatch.setattr(part.PassedPart, "_before", without)
        scene = arm().event("stop", "elbow.rotation", 0.1, *EVENTS["impact"]).scene()
        assert disagreement(scene, 0.9, [*NUMBERS, "stop.level"], ["elbow.rotation"]) > 1e-3
        return
    a, node = arc.SCHEMES["rk4"]
    a = a.copy()
    a[4, 3] *= 1.001
    monkeypatch.setitem(arc.SCHEMES, "rk4", arc.Scheme(a, node))
    assert disagreement(arm().scene(), 0.5, NUMBERS, ["elbow.rotation"], method="rk4", step=1e-2) > 1e-6


def test_scalars_and_runs_without_gradient_are_refused():
    scene, final = arm().scene(), fm.FinalValue("elbow.rotation")
    with pytest.raises(fm.DynamicsError, match="does not reach t = 2 s"):
        ended = arm().event("over", "elbow.rotation", 0.1, fm.EndRun()).scene()
        fm.gradient(ended, 2.0, ["rod.mass_kg"], final)
    with pytest.raises(ValueError, match='there is no "weight"'):
        fm.gradient(scene, 1.0, ["rod.weight"], final)
    with pytest.raises(ValueError, match="no output 'elbow.rotatio'"):
        fm.gradient(scene, 1.0, ["rod.mass_kg"], fm.FinalValue("elbow.rotatio"))
    with pytest.raises(TypeError, match="give a FinalValue, a Misfit or a TimeIntegral"):
        fm.gradient(scene, 1.0, ["rod.mass_kg"], "elbow.rotation")
    with pytest.raises(ValueError, match="scalar has no terms"):
        fm.gradient(scene, 1.0, ["rod.mass_kg"], [])
    with pytest.raises(ValueError, match='use "dop853" or "rk4"'):
        fm.gradient(scene, 1.0, ["rod.mass_kg"], final, "radau5")
    with pytest.raises(ValueError, match="go on to t = 2 s, but t_end is 1 s"):
        data = {"t": [0.0, 2.0], "elbow.rotation": [0.5, 0.4]}
        fm.gradient(scene, 1.0, ["rod.mass_kg"], fm.Misfit(data))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fm.FinalValue(3), "named by a string"),
        (lambda: fm.FinalValue("work", weight=np.nan), "weight"),
        (lambda: fm.TimeIntegral("work", panels=0), "panels is 0"),
        (lambda: fm.TimeIntegral("work", level=1.0), "set squared=True"),
        (lambda: fm.Misfit({"t": [0.0, 1.0], "work": [0.0, 0.0]}, sigma=0.0), "positive"),
        (lambda: fm.Misfit({"t": [0.0, 1.0], "work": [0.0, 0.0]}, sigma={"nobody": 1.0}), "the channels are work"),
    ],
)
def test_terms_that_make_no_sense_are_refused(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


def test_an_optimiser_takes_it():
    """The stiffness and damping with which a swing is nearest to a recorded one, found from its gradient alone."""
    from scipy.optimize import minimize

    scene, by = arm().scene(), ["elbow.rotation.stiffness_Nm_rad", "pivot.rotation.damping_Nms_rad"]
    true = np.array([1.3, 0.2])
    run = fm.simulate(scene.with_values(dict(zip(by, true.tolist(), strict=True))), 1.5, samples=31)
    data = {name: values for name, _, values in run.columns() if name in ("t", "elbow.rotation", "pivot.rotation")}

    def cost(x):
        found = fm.gradient(scene.with_values(dict(zip(by, x.tolist(), strict=True))), 1.5, by, fm.Misfit(data))
        return found.value, found.derivatives

    found = minimize(cost, [1.0, 0.1], jac=True, method="BFGS", options={"gtol": 1e-10})
    assert np.max(np.abs(found.x - true)) < 1e-5


def test_an_integral_is_cut_where_sampled_controllers_act():
    """Few panels find what many do, though 13 instants lie within them; the signal is constant between them."""
    scene = scenes.with_feedback(scenes.pendulum(), period=0.037).with_values({"servo.kd": 0.1})
    few, many = (
        fm.gradient(scene, 0.5, ["servo.kd"], fm.TimeIntegral("signal.servo[0]", squared=True, panels=panels), **TIGHT)
        for panels in (2, 200)
    )
    starts = np.arange(14) * 0.037
    run = fm.simulate(scene, 0.5, samples=[0.0, *(starts + 1e-3), 0.5], **TIGHT)
    held = {name: values for name, _, values in run.columns()}["signal.servo[0]"][1:-1]
    assert few.value == pytest.approx(np.sum(held**2 * np.diff([*starts, 0.5])), rel=1e-9)
    assert few.value == pytest.approx(many.value, rel=1e-12)
    np.testing.assert_allclose(few.derivatives, many.derivatives, rtol=1e-10)


@pytest.mark.parametrize("kind", ["spherical", "revolute", "cylindrical"])
def test_planar_loops_with_closures_of_every_kind(kind):
    """Rows that a plane mechanism cannot move count for nothing, whichever of a closure's rows these are."""
    scene = fm.SceneBuilder("four-bar", gravity=(0.0, -9.81, 0.0))
    for name, length in (("crank", 0.4), ("coupler", 1.0), ("rocker", 0.7)):
        scene.rigid_body(name, mass=1.0, com=(0.5 * length, 0.0, 0.0), inertia=(0.03, 0.03, 0.05),
                         nodes={"end": (length, 0.0, 0.0)})
    scene.revolute("A", "ground", "crank", axis=(0, 0, 1), angle=1.0, rate=2.0)
    scene.revolute("B", "crank", "coupler", axis=(0, 0, 1), angle=-0.63, parent_node="end")
    scene.revolute("C", "ground", "rocker", axis=(0, 0, 1), angle=1.5, parent_position=(1.1, 0.0, 0.0))
    scene.closure("D", kind, "coupler", "rocker", node_a="end", node_b="end")
    made = scene.scene()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fm.SceneWarning)  # the start is rough
        found = disagreement(made, 0.3, ["coupler.mass_kg", "crank.nodes.end.position_m.0"], ["B.rotation"])
    assert found < OTHER_STEPS


def test_loads_that_closures_leave_undetermined_are_refused():
    """In a plane loop with four hinges, loads out of the plane have no value, and their scalars no gradient."""
    scene = mechanisms.four_bar()
    by, channel = [f"{scene.bodies[0].name}.mass_kg"], "loop.force.z"
    run = fm.sensitivities(scene, 0.01, by, [channel], samples=2)
    assert np.all(np.isnan(run.values))
    for term in (fm.FinalValue(channel), fm.TimeIntegral(channel)):
        with pytest.raises(fm.DynamicsError, match="not determined"):
            fm.gradient(scene, 0.01, by, term)


STRIKE = fm.Impact(coordinate="pivot.rotation", restitution=0.6)
WATCHES = {
    "sampled": (0.05, "pivot.rotation", -0.2), "continuous": (None, "pivot.rotation", -0.2),
    "continuous, on a signal": (None, "place[1]", -0.25),
}  # fmt: skip


@pytest.mark.parametrize("channel", ["signal.servo[0]", "pivot.rotation.rate", "centre.acceleration.x"])
@pytest.mark.parametrize("kind", WATCHES)
def test_integrals_over_an_event_that_moves_under_controllers_against_differences(kind, channel):
    """What signals held when the event came, and not later, is what the integral gains where the event moves."""
    period, watch, level = WATCHES[kind]
    sampling = {} if period is None else {"period": period, "delay": 0.07}
    scene = controlled(**sampling).event("stop", watch, level, STRIKE).scene()
    of = [fm.TimeIntegral(channel, squared=True), fm.FinalValue("pivot.rotation")]
    by = {"stop.level": level, "servo.kp": 1.0}

    def found(values: dict[str, float]) -> fm.Gradient:
        return fm.gradient(scene.with_values(values), 0.97, list(by), of, **TIGHT)

    exact = found({})
    assert any(event.name == "stop" for event in exact.trajectory.events)
    for name, value in by.items():
        slopes = [
            (found({name: value + h}).value - found({name: value - h}).value) / (2.0 * h) for h in (2e-4, 1e-4)
        ]  # fmt: skip
        assert exact.derivative(name) == pytest.approx((4.0 * slopes[1] - slopes[0]) / 3.0, rel=1e-7, abs=1e-8)


def test_derivatives_at_too_many_instants_are_refused_before_the_run(monkeypatch):
    """Forwards, each instant keeps the derivatives of the state; backwards none does."""
    of = fm.TimeIntegral("pivot.rotation", panels=2_000)
    monkeypatch.setattr(sizes, "MOST_BYTES", 2**20)
    with pytest.raises(ValueError, match="at 8000 instants take .*give fewer panels or numbers"):
        fm.gradient(controlled().scene(), 0.1, CONTROLLED, of)
    assert fm.gradient(controlled(period=0.05).scene(), 0.1, CONTROLLED, of).checkpoints > 0


def test_forwards_and_backwards_are_one_gradient(monkeypatch):
    """Of a run that both pass: misfits, integrals and final values through an event that moves."""
    scene = controlled(period=0.05, delay=0.07).event("stop", "pivot.rotation", -0.2, STRIKE).scene()
    of = [
        fm.TimeIntegral("signal.servo[0]", squared=True, level=0.1), fm.FinalValue("work", weight=-2.0),
        fm.Misfit({"t": [0.0, 0.33, 0.9], "pivot.rotation": [0.1, 0.2, -0.1]}, sigma=0.5),
    ]  # fmt: skip
    backwards = fm.gradient(scene, 0.97, [*CONTROLLED, "stop.level"], of, **TIGHT)
    monkeypatch.setattr(gradient_module, "is_passed_backwards", lambda scene: False)
    forwards = fm.gradient(scene, 0.97, [*CONTROLLED, "stop.level"], of, **TIGHT)
    assert forwards.checkpoints == 0 < backwards.checkpoints
    assert forwards.value == pytest.approx(backwards.value, rel=1e-10)
    scale = np.max(np.abs(backwards.derivatives))
    assert np.max(np.abs(forwards.derivatives - backwards.derivatives)) < OTHER_STEPS * scale
