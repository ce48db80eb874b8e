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


def test_controllers_go_on_across_events() -> None:
    """An event that changes nothing of the motion changes nothing of the control either, to rounding of the steps."""
    law = fm.StateSpace(
        name="law", inputs=("angle", "rate"), A=((0.5,),), B=((1.0, 0.0),), C=((-2.0,),), D=((-3.0, -0.5),),
        period_s=0.1, delay_s=0.05,
    )  # fmt: skip
    plain = rotor(law)
    event = fm.SceneEvent(
        name="nothing", watch="pivot.rotation", level=0.1,
        actions=(fm.Change(path="pivot.rotation.stiffness_Nm_rad", value=0.0),),
    )  # fmt: skip
    with_event = fm.simulate(rotor(law, event), 2.0, samples=21)
    alone = fm.simulate(plain, 2.0, samples=21)
    assert with_event.events
    assert np.abs(with_event.q - alone.q).max() < 1e-9
    assert np.abs(with_event.signals["law"] - alone.signals["law"]).max() < 1e-8
    assert np.abs(with_event.energy_drift).max() < 1e-9


def test_states_that_are_integrated_refuse_events() -> None:
    law = fm.StateSpace(name="law", inputs=("angle",), A=((-1.0,),), B=((1.0,),), C=((-1.0,),))
    event = fm.SceneEvent(name="end", watch="time", level=0.5, actions=(fm.EndRun(),))
    with pytest.raises(NotImplementedError, match="continuous and has states, and the scene has events"):
        fm.simulate(rotor(law, event), 1.0)
    static = fm.StateSpace(name="law", inputs=("angle",), D=((-1.0,),))
    run = fm.simulate(rotor(static, event), 1.0)
    assert run.stopped_at == 0.5
    assert run.signals["law"][-1, 0] == -run.q[-1, 0]
