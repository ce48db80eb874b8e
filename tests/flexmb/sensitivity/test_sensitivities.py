"""Derivatives of whole runs: closed forms, and extrapolated differences of runs, which share nothing with them."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.ready import scenes
from flexmb.sensitivity import jump
from flexmb.sensitivity.impulses import Striking
from tests.flexmb.control.scenes import driven_four_bar
from tests.flexmb.sensitivity.differences import differences, outputs, relative_error
from tests.repo.project import ROOT

# Errors of a step are below 1e-10 of a derivative, or 1e-12 of the change by a hundredth of the number: 1e-10 of one of
# magnitude 1, and errors of steps add up. Differences of runs of 1e-13 over steps of 3e-3 are exact to 1e-10.
CLOSE = 1e-7
STEP = 3e-3  # of a number, relative
STATES = ["pivot.rotation", "elbow.rotation", "elbow.rotation.rate", "tip.position.x", "pivot.force.z", "work"]


def arm(name: str = "arm") -> fm.SceneBuilder:
    """A double pendulum with springs and dampers, whose elbow swings through 0.1 rad after 0.4 s."""
    return (
        fm.SceneBuilder(name, gravity=(0, 0, -9.81))
        .rigid_body("rod", mass=2.0, inertia=(0.1, 0.2, 0.3))
        .rigid_body("arm", mass=1.0, inertia=(0.05, 0.06, 0.07))
        .revolute(
            "pivot", "ground", "rod", axis=(0, 1, 0), angle=0.8, damping=0.1, stiffness=2.0, child_position=(0, 0, 0.5)
        )
        .revolute(
            "elbow", "rod", "arm", axis=(0, 1, 0), angle=0.5, stiffness=1.0, damping=0.02, parent_position=(0, 0, -0.5),
            child_position=(0, 0, 0.3),
        )
        .marker("tip", "arm")
    )  # fmt: skip


NUMBERS = ["rod.mass_kg", "pivot.rotation.angle_rad", "pivot.rotation.damping_Nms_rad", "arm.inertia_kg_m2.1.1"]


def agrees(scene, t_end, by, of=tuple(STATES), step=STEP, tolerance=CLOSE, **settings):
    """The derivatives of a run, after each was compared with differences."""
    found = fm.sensitivities(scene, t_end, by, of, samples=21, **settings)
    for k, name in enumerate(found.parameters):
        h = step * abs(found.parameter_values[k])
        # An event moves by at most twice h times the derivative of its time, and with it what happens there.
        apart = 2.0 * h * max((abs(event.derivatives[k]) for event in found.events), default=0.0)
        other = differences(scene, t_end, name, of, h)
        assert np.max(relative_error(found, name, other, apart)) < tolerance, name
        for event, moved in zip(found.events, other.events, strict=True):
            assert abs(event.derivatives[k] - moved) <= tolerance * max(
                abs(moved), abs(event.t / found.parameter_values[k])
            ), name
    return found


def test_an_oscillator_has_its_closed_form():
    """x = A cos(w t), w^2 = k/m: by A, by k and by m."""
    scene = (
        fm.SceneBuilder("oscillator")
        .rigid_body("mass", mass=2.0, inertia=(1.0, 1.0, 1.0))
        .prismatic("rail", "ground", "mass", axis=(0, 0, 1), position=0.3, stiffness=8.0)
        .scene()
    )
    by = ["rail.translation.position_m", "rail.translation.stiffness_N_m", "mass.mass_kg"]
    found = fm.sensitivities(scene, 5.0, by, ["rail.translation", "rail.translation.rate", "energy.total"])
    t, A, k, m = found.t, 0.3, 8.0, 2.0
    w = np.sqrt(k / m)
    by_w = -A * t * np.sin(w * t)
    x = np.stack([np.cos(w * t), by_w * w / (2.0 * k), -by_w * w / (2.0 * m)], axis=1)
    by_w = -A * np.sin(w * t) - A * w * t * np.cos(w * t)
    v = np.stack([-w * np.sin(w * t), by_w * w / (2.0 * k), -by_w * w / (2.0 * m)], axis=1)
    energy = np.broadcast_to([k * A, A**2 / 2.0, 0.0], x.shape)
    exact = np.stack([x, v, energy], axis=1)
    assert np.max(np.abs(found.derivatives - exact)) < 1e-8 * np.max(np.abs(exact))


def test_a_pendulum_scales_with_gravity():
    """Its angle depends on g by sqrt(g) t alone, from rest: d theta/dg = t theta'/(2 g), however large the swing is."""
    scene = (
        scenes.pendulum().scene().with_values({"pivot.rotation.stiffness_Nm_rad": 0.0, "pivot.rotation.angle_rad": 0.9})
    )
    found = fm.sensitivities(scene, 4.0, ["gravity_m_s2.1"], ["pivot.rotation"])
    exact = found.t * found.trajectory.u[:, 0] / (2.0 * -9.81)
    assert np.max(np.abs(found.derivatives[:, 0, 0] - exact)) < 1e-8 * np.max(np.abs(exact))


def test_smooth_runs_agree_with_differences():
    found = agrees(arm().scene(), 1.5, NUMBERS)
    assert found.derivative("work", "rod.mass_kg").shape == (21,)
    assert found.outputs == tuple(STATES) and found.units[0] == "rad"


def test_rk4_differentiates_its_own_run():
    """With equal steps the derivative is that of the discrete run, which differences of it have too."""
    found = fm.sensitivities(arm().scene(), 0.5, ["rod.mass_kg"], ["elbow.rotation"], "rk4", samples=6, step=1e-2)

    def run(mass):
        scene = arm().scene().with_values({"rod.mass_kg": mass})
        return outputs(fm.simulate(scene, 0.5, "rk4", samples=6, step=1e-2), ["elbow.rotation"])

    rough, fine = ((run(2.0 + h) - run(2.0 - h)) / (2.0 * h) for h in (2e-3, 1e-3))
    assert np.max(np.abs(found.derivatives[:, :, 0] - (4.0 * fine - rough) / 3.0)) < 1e-10


EVENTS = {
    "latch": (fm.Latch(coordinate="elbow.rotation"),),
    "impact": (fm.Impact(coordinate="elbow.rotation", restitution=0.7),),
    "another coordinate": (fm.Latch(coordinate="pivot.rotation"),),
    "change": (fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=30.0),),
}


@pytest.mark.parametrize("kind", EVENTS)
def test_runs_through_events_agree_with_differences(kind):
    scene = arm().event("stop", "elbow.rotation", 0.1, *EVENTS[kind]).scene()
    by = [*NUMBERS, "stop.level", "pivot.rotation.stiffness_Nm_rad"]
    by += ["events.stop.actions.0.restitution"] if kind == "impact" else []
    found = agrees(scene, 0.9, by)
    assert found.events and {event.name for event in found.events} == {"stop"}


def test_a_release_and_events_on_time_agree_with_differences():
    scene = (
        arm()
        .event("stop", "elbow.rotation", 0.1, fm.Latch(coordinate="elbow.rotation"))
        .event("go", "time", 0.8, fm.Release(coordinate="elbow.rotation"))
        .event("stiffer", "time", 1.1, fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=30.0))
        .scene()
    )
    agrees(scene, 1.5, ["rod.mass_kg", "stop.level", "go.level", "stiffer.level", "pivot.rotation.stiffness_Nm_rad"])


@pytest.mark.parametrize("left_out", ["the time of the event", "the impulse"])
def test_leaving_out_a_part_of_the_jump_is_noticed(monkeypatch, left_out):
    """Negative control of the comparison."""
    if left_out == "the time of the event":
        monkeypatch.setattr(jump, "_time", lambda variation, end, *_: np.zeros(end.Y.shape[1]))
    else:
        monkeypatch.setattr(Striking, "struck", lambda self, D, *_: D)
    scene = arm().event("stop", "elbow.rotation", 0.1, *EVENTS["impact"]).scene()
    with pytest.raises(AssertionError, match="rod.mass_kg"):
        agrees(scene, 0.6, ["rod.mass_kg"])


def test_a_ring_down_of_a_flexible_body_agrees_with_differences():
    scene = scenes.panelled(2, "full").scene()
    scene = scene.with_values({"panel.stations.*.EIy_Nm2": 20.0, "panel.modes.damping_ratio": 0.02})
    by = [
        "panel.stations.*.EIz_Nm2",
        "panel.modes.damping_ratio",
        "panel.stations.*.mass_per_length_kg_m",
        "bob.mass_kg",
    ]
    of = ["pivot.rotation", "tip.position.x", "tip.acceleration.y", "root.torque.z", "root.force.x"]
    agrees(scene, 0.5, by, of)


@pytest.mark.parametrize("sampling", [{}, {"period": 0.05, "delay": 0.01}], ids=["continuous", "sampled"])
def test_controllers_agree_with_differences(sampling):
    """A PID controller with a filter, and one of states that reads an acceleration; both push."""
    builder = (
        scenes.pendulum().sense_marker("place", "centre", "position").sense_marker("acc", "centre", "acceleration")
    )
    builder.pid("servo", "place[1]", kp=1.0, ki=1.0, kd=0.5, filter=0.1, **sampling)
    law = {"A": [[-1.0]], "B": [[0.1, 0.2]], "C": [[1.0]], "D": [[0.0, 0.1]]}
    builder.state_space("law", ["acc[0]", "place[0]"], **law, **sampling)
    builder.torque("twist", "bob", direction=(0, 0, 1), function=fm.ControlSignal(source="law", gain=-0.7))
    push = fm.ControlSignal(source="servo", gain=2.0)
    scene = builder.torque("push", "bob", direction=(0, 0, 1), function=push).scene()
    by = ["bob.mass_kg", "controllers.servo.kp", "servo.ki", "servo.kd", "servo.filter_s", "law.A.0.0", "law.B.0.1",
          "twist.function.gain", "pivot.rotation.stiffness_Nm_rad"]  # fmt: skip
    of = [
        "pivot.rotation",
        "pivot.rotation.rate",
        "centre.acceleration.x",
        "signal.servo[0]",
        "signal.law[0]",
        "signal.acc[1]",
    ]
    agrees(scene, 1.0, by, of, tolerance=1e-6)


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")  # of the runs with other numbers
def test_a_four_bar_agrees_with_differences():
    """By masses and by lengths, on which the closure depends, through an impulse that its rows carry on."""
    scene = fm.load_scene(ROOT / "cases" / "closed_chains" / "four_bar" / "scene.toml")
    hit = fm.SceneEvent(
        name="hit", watch="drive.rotation", level=1.2, actions=(fm.Impact(coordinate="drive.rotation"),)
    )
    scene = msgspec.structs.replace(scene, events=(hit,))
    by = ["crank.mass_kg", "coupler.com_m.0", "drive.rotation.rate_rad_s", "bodies.rocker.nodes.tip.position_m.0"]
    of = [
        "drive.rotation",
        "pivot.rotation",
        "joint.position.x",
        "joint.acceleration.y",
        "loop.force.x",
        "energy.total",
    ]
    agrees(scene, 0.4, by, of, step=3e-4, tolerance=1e-6)


@pytest.mark.filterwarnings("ignore:.*the closures do not allow these values")  # of the runs with other numbers
@pytest.mark.parametrize("sampling", [{}, {"period_s": 0.05, "delay_s": 0.02}], ids=["continuous", "sampled"])
def test_a_controlled_four_bar_agrees_with_differences(sampling):
    """The loads of its closure follow what the controller drives."""
    by = ["crank.mass_kg", "coupler.com_m.0", "servo.kp", "drive.rotation.torque_Nm.gain"]
    of = ["drive.rotation", "pivot.rotation.rate", "loop.force.x", "signal.servo[0]"]
    agrees(driven_four_bar(**sampling), 0.33, by, of, step=3e-4, tolerance=1e-6)


def test_a_chain_without_its_drives_would_not_agree(monkeypatch):
    """Negative control: the loads of closures as they are without what controllers drive."""
    from flexmb.sensitivity import blocks

    real = blocks.chain.ChainBlock
    alone = np.zeros(0, np.int64)
    monkeypatch.setattr(blocks.chain, "ChainBlock", lambda **tables: real(**(tables | {"driven": alone})))
    with pytest.raises(AssertionError):
        agrees(driven_four_bar(), 0.33, ["crank.mass_kg"], ["drive.rotation"], step=3e-4, tolerance=1e-3)


def test_an_event_on_a_load_agrees_with_differences():
    """A spring changes whenever the load of the hinge passes a level, and a stop is where a marker reaches a height."""
    builder = scenes.pendulum().sense_marker("place", "centre", "position").sense_load("load", "pivot")
    builder.event("low", "place[0]", 0.5, fm.Impact(coordinate="pivot.rotation", restitution=0.5))
    builder.event("heavy", "load[4]", 12.0, fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=10.0))
    found = agrees(
        builder.scene(), 1.0, ["bob.mass_kg", "low.level", "pivot.rotation.stiffness_Nm_rad"], ["pivot.rotation"]
    )
    assert [event.name for event in found.events] == ["heavy", "heavy", "low", "heavy"]


OF_THE_SATELLITE = (
    ["hub.mass_kg", "attitude.parameters.3", "left latches.level"],
    [
        "hub.inertia_kg_m2.1.1", "left_hinge.rotation.stiffness_Nm_rad", "left_hinge.rotation.damping_Nms_rad",
        "right_hinge.rotation.stiffness_Nm_rad", "slosh.mass_kg", "slosh.coordinates.0.stiffness_N_m",
        "left.stations.*.EIy_Nm2", "left.stations.*.mass_per_length_kg_m", "attitude.parameters.8",
    ],
)  # fmt: skip


@pytest.mark.parametrize("by", OF_THE_SATELLITE, ids=["some", "more"])
def test_the_satellite_agrees_with_differences(by):
    """A sampled law of a user, delays, two latches: 100 s, by twelve numbers.

    The run jumps where a latch passes a sampling instant, 4 ms after the second one: steps move events by less.
    """
    scene = fm.load_scene(ROOT / "cases" / "spacecraft" / "deploy_and_slew" / "scene.toml")
    of = ["left_tip.position.x", "right_tip.position.y", "left_hinge.torque.y", "tracker.quaternion.x", "wheel_y.speed"]
    found = fm.sensitivities(scene, 100.0, by, of, samples=21)
    for k, name in enumerate(by):
        most = max(abs(event.derivatives[k]) for event in found.events)
        value = abs(found.parameter_values[k]) or 1.0
        other = differences(scene, 100.0, name, of, min(STEP * value, 1e-3 / most))
        # Differences of small effects are less exact than the derivatives: their rounding is 1e-12 over the change.
        size = np.max(np.abs(other.outputs), axis=0)
        rounding = 1e-11 * np.max(np.abs(found.values), axis=0) / (min(STEP * value, 1e-3 / most) * size)
        assert np.all(relative_error(found, name, other) < 1e-6 + rounding), name
