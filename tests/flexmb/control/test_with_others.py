"""Controllers together with connectors and events, and in place of them: several drives on one hinge, told by
controllers or by time, and controllers that do what springs and dampers do."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.files import dumps, loads
from tests.flexmb.control.scenes import INERTIA, pendulum, rotor


def test_an_actuator_of_a_connector_is_driven() -> None:
    """Between ground and a slider, it does what the slider's own motor does."""
    law = fm.StateSpace(name="law", inputs=("where", "rate"), D=((-30.0, -2.0),), period_s=0.05, delay_s=0.01)

    def cart(force: fm.ControlSignal | None) -> fm.SceneBuilder:
        return (
            fm.SceneBuilder("cart").rigid_body("cart", mass=2.0, inertia=(1.0, 1.0, 1.0))
            .prismatic("slide", "ground", "cart", axis=(1, 0, 0), position=1.5, force=force)
            .sense_coordinate("where", "slide").sense_coordinate("rate", "slide", quantity="rate").add(law)
        )  # fmt: skip

    signal = fm.ControlSignal(source="law")
    motor = fm.simulate(cart(signal).scene(), 2.0)
    connected = cart(None).spring_damper("pusher", "ground", "cart", position_a=(-10.0, 0.0, 0.0), force=signal)
    run = fm.simulate(connected.scene(), 2.0)
    assert np.abs(run.q - motor.q).max() < 1e-12
    assert np.abs(run.energy_drift).max() < 1e-10
    assert run.power["law"] == pytest.approx(motor.power["law"], abs=1e-10)


SAMPLED = fm.StateSpace(
    name="law", inputs=("angle", "rate"), A=((0.5,),), B=((1.0, 0.0),), C=((-2.0,),), D=((-3.0, -0.5),), period_s=0.1,
    delay_s=0.05,
)  # fmt: skip
CONTINUOUS = fm.StateSpace(name="law", inputs=("angle", "rate"), A=((-2.0,),), B=((1.0, 0.3),), C=((-3.0,),))


@pytest.mark.parametrize("law", [SAMPLED, CONTINUOUS], ids=["sampled", "continuous"])
def test_controllers_go_on_across_events(law: fm.StateSpace) -> None:
    """An event that changes nothing of the motion changes nothing of the control either, to the error of the steps."""
    event = fm.SceneEvent(
        name="nothing", watch="pivot.rotation", level=0.1,
        actions=(fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=0.0),),
    )  # fmt: skip
    with_event = fm.simulate(rotor(law, event), 2.0, samples=21)
    alone = fm.simulate(rotor(law), 2.0, samples=21)
    assert with_event.events
    assert np.abs(with_event.q - alone.q).max() < 1e-9
    assert np.abs(with_event.signals["law"] - alone.signals["law"]).max() < 1e-8
    assert np.abs(with_event.energy_drift).max() < 1e-9


@pytest.mark.parametrize("law", [SAMPLED, CONTINUOUS], ids=["sampled", "continuous"])
def test_a_run_that_an_event_ends_shows_its_signals_there(law: fm.StateSpace) -> None:
    event = fm.SceneEvent(name="end", watch="time", level=0.55, actions=(fm.EndRun(),))
    run = fm.simulate(rotor(law, event), 1.0)
    assert run.stopped_at == run.t[-1] == 0.55
    assert run.signals["angle"][-1, 0] == run.q[-1, 0]
    assert run.loads["pivot"][-1, 2] == pytest.approx(run.signals["law"][-1, 0], abs=1e-12)
    assert run.signals["law"][-1, 0] != 0.0


@pytest.mark.parametrize("period", [None, 0.1])
def test_an_event_switches_a_controller_off(period: float | None) -> None:
    """What it drove turns evenly from then on; at the gain that it has anyway nothing changes."""
    law = fm.Pid(name="law", inputs=("rate",), kp=2.0, setpoint=1.0, period_s=period)
    runs = [
        fm.simulate(rotor(law, fm.SceneEvent(
            name="switch", watch="time", level=0.55, actions=(fm.Change(path="law.kp", value=gain),)
        )), 1.0, samples=101) for gain in (0.0, 2.0)
    ]  # fmt: skip
    alone = fm.simulate(rotor(law), 1.0, samples=101)
    off, on = runs
    later = off.t > (0.6 if period else 0.55)  # a sampled one is asked at its next instant
    assert np.ptp(off.u[later, 0]) < 1e-12 and np.ptp(on.u[later, 0]) > 1e-2
    assert np.abs(on.q - alone.q).max() < 1e-9 and np.abs(off.energy_drift).max() < 1e-9


def test_the_open_loop_has_no_events_of_feedback() -> None:
    law = fm.Pid(name="law", inputs=("rate",), kp=2.0, period_s=0.1)
    end, change = fm.EndRun(), fm.Change(path="law.kp", value=0.0)
    events = [
        fm.SceneEvent(name=name, watch=watch, level=1.0, actions=(action,))
        for name, watch, action in (("a", "law", end), ("b", "time", change), ("c", "pivot.rotation", end))
    ]
    assert [event.name for event in fm.open_loop(rotor(law, *events)).events] == ["c"]


ONE = fm.ProfileSensor(name="one", function=fm.Constant(value=1.0))
APART = fm.DistanceSensor(name="apart", marker_a="hip", marker_b="end")
STIFF, LOSSY, FREE = 12.0, 0.7, 0.5
ENDS: dict[str, Any] = {"position_a": (0.2, 0.1, 0.3), "position_b": (0.8, 0.0, 0.0), "free_length": FREE}
RUN: dict[str, Any] = {"t_end": 1.0, "samples": 11, "rtol": 1e-11, "atol": 1e-13}


def passive() -> fm.Scene:
    return pendulum().spring_damper("strut", "upper", "lower", stiffness=STIFF, damping=LOSSY, **ENDS).scene()


def active(stiffness: float = STIFF) -> fm.Scene:
    """An actuator along the same line, told by the distance of its ends and its rate."""
    gains = ((-stiffness, -LOSSY, STIFF * FREE),)
    law = fm.StateSpace(name="law", inputs=("apart", "one[0]"), D=gains)
    builder = pendulum(ONE, APART, law).marker("hip", "upper", offset=ENDS["position_a"])
    return builder.spring_damper("strut", "upper", "lower", force=fm.ControlSignal(source="law"), **ENDS).scene()


def test_an_actuator_told_by_a_distance_is_a_strut() -> None:
    """What its spring stores is its work, for nobody knows that a controller is a spring."""
    ours, springs = fm.simulate(active(), **RUN), fm.simulate(passive(), **RUN)
    assert np.max(np.abs(ours.q - springs.q)) <= 1e-9
    assert np.max(np.abs(ours.connectors["strut"] - springs.connectors["strut"])) <= 1e-8
    stored = springs.energy["spring"] - springs.energy["spring"][0]
    assert np.max(np.abs(ours.work - springs.work + stored)) <= 1e-8 and np.ptp(stored) > 0.1
    assert np.max(np.abs(ours.energy_drift)) <= 1e-9 * ours.energy_scale
    stiffer = fm.simulate(active(1.001 * STIFF), **RUN)
    assert np.max(np.abs(stiffer.q - springs.q)) > 1e-5


def test_and_has_the_strut_s_poles() -> None:
    found, expected = (np.sort_complex(fm.linearize(scene).eigenvalues) for scene in (active(), passive()))
    assert found == pytest.approx(expected, rel=1e-8)


TABLE = fm.GainTable(name="law", inputs=("angle",), points=(-1.0, 1.0), values=(3.0, -3.0))
GAIN = fm.StateSpace(name="gain", inputs=("angle",), D=((-3.0,),))


@pytest.mark.parametrize(("parts", "stiffness"), [
    ((TABLE,), 3.0),
    ((GAIN, fm.Saturation(name="law", inputs=("gain",), lower=-2.0, upper=2.0)), 3.0),
    ((GAIN, fm.Saturation(name="law", inputs=("gain",), lower=-0.1, upper=0.1)), 0.0),
], ids=["a table", "within limits", "at a limit"])  # fmt: skip
def test_slopes_of_tables_and_limits(parts: Any, stiffness: float) -> None:
    """J s^2 = -k: at a limit nothing holds the rotor."""
    A = fm.linearize(rotor(*parts)).A
    assert np.max(np.abs(A - [[0.0, 1.0], [-stiffness / INERTIA, 0.0]])) <= 1e-9


PUSH = fm.Sine(amplitude=2.0, angular_frequency_rad_s=3.0)
SERVO: dict[str, Any] = {"kp": 8.0, "kd": 1.0, "filter": 0.05}
RUN: dict[str, Any] = {"t_end": 1.0, "samples": 11, "rtol": 1e-11, "atol": 1e-13}


def shared(**sampling: Any) -> fm.Scene:
    """A servo as the hinge's motor, a profile and a second controller as actuators."""
    return (
        pendulum(torque=fm.ControlSignal(source="servo"))
        .pid("servo", "angle", **SERVO, **sampling)
        .state_space("brake", "rate", D=[[-0.7]])
        .angular_spring("push", "pivot", torque=PUSH)
        .angular_spring("shoe", "pivot", torque=fm.ControlSignal(source="brake"))
        .scene()
    )


def summed() -> fm.Scene:
    """All of it in one signal."""
    return (
        pendulum(torque=fm.ControlSignal(source="sum"))
        .sense_profile("push", PUSH)
        .pid("servo", "angle", **SERVO)
        .state_space("sum", ["servo", "rate", "push[0]"], D=[[1.0, -0.7, 1.0]])
        .scene()
    )


def test_they_add_up() -> None:
    one, other = fm.simulate(shared(), **RUN), fm.simulate(summed(), **RUN)
    assert np.max(np.abs(one.q - other.q)) <= 1e-9 and np.max(np.abs(one.work - other.work)) <= 1e-9
    assert np.max(np.abs(one.energy_drift)) <= 1e-9 * one.energy_scale
    assert one.hinge_forces["push"][:, 0] == pytest.approx(2.0 * np.sin(3.0 * one.t), abs=1e-12)
    assert one.hinge_forces["shoe"] == pytest.approx(one.signals["brake"], abs=1e-12)
    assert one.power["brake"] == pytest.approx(one.signals["brake"] * one.u[:, :1], abs=1e-12)
    left_out = msgspec.structs.replace(shared(), connectors=shared().connectors[1:])
    assert np.max(np.abs(fm.simulate(left_out, **RUN).q - other.q)) > 1e-2


@pytest.mark.parametrize("method", ["radau5", "exponential"])
def test_methods_with_jacobians_know_them(method: str) -> None:
    one = fm.simulate(shared(), **RUN | {"method": method, "rtol": 1e-9, "atol": 1e-11})
    assert np.max(np.abs(one.q - fm.simulate(summed(), **RUN).q)) <= 1e-7


def test_a_sampled_one_beside_a_profile() -> None:
    """Between its instants the servo's torque stands still, and the profile goes on."""
    run = fm.simulate(shared(period=0.1), **RUN)
    assert np.max(np.abs(run.energy_drift)) <= 1e-9 * run.energy_scale
    assert run.hinge_forces["push"][:, 0] == pytest.approx(2.0 * np.sin(3.0 * run.t), abs=1e-12)


def test_linear_models_have_them_all() -> None:
    one, other = (fm.linearize(scene).A for scene in (shared(), summed()))
    assert np.max(np.abs(one - other)) <= 1e-9 * np.max(np.abs(one))


def test_along_a_slide() -> None:
    """m x'' = f1 + f2 + f3."""
    scene = (
        fm.SceneBuilder("slide")
        .rigid_body("block", mass=INERTIA, inertia=(1, 1, 1))
        .prismatic("rail", "ground", "block", axis=(1, 0, 0), force=fm.Constant(value=1.0))
        .linear_spring("second", "rail", force=fm.Constant(value=2.0))
        .linear_spring("third", "rail", force=fm.Constant(value=-0.5))
        .scene()
    )
    assert fm.compile(scene).accelerations(fm.compile(scene).initial_state) == pytest.approx([2.5 / INERTIA])


def test_files_have_them() -> None:
    assert loads(dumps(shared())) == shared()
