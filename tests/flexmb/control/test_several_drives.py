"""Several drives on one hinge: its own motor, and actuators of springs along it, told by controllers or by time."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

import flexmb as fm
from flexmb.scene.files import dumps, loads
from tests.flexmb.control.scenes import INERTIA, pendulum

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
