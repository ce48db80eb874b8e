"""Controllers together with connectors and events."""

from __future__ import annotations

import numpy as np
import pytest

import flexmb as fm
from tests.flexmb.control.scenes import rotor


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
