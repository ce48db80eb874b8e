"""Spacecraft under attitude controllers, sampled and late: turned by wheels, and with hinged flexible panels and
slosh."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import flexmb as fm
from flexmb.control.attitude import eigenaxis_slew
from flexmb.scene.shapes import beam_section

INERTIA = np.array([120.0, 130.0, 140.0])
STIFFNESS, DAMPING = INERTIA * 0.4**2, 1.4 * INERTIA * 0.4
PERIOD, DELAY = 0.1, 0.05
SECTION = beam_section(E=7e10, G=2.7e10, A=4e-4, Iy=4e-8, Iz=4e-8, rho=2700.0)
MODES = fm.Modes(count=3, families=("bending_y", "bending_z"), damping_ratio=0.005)


def satellite(folded: float) -> fm.SceneBuilder:
    """Panels whose hinges stand at +-`folded` (rad) and are sprung to 0."""
    builder = (
        fm.SceneBuilder("satellite").rigid_body("hub", mass=400.0, inertia=INERTIA).free("orbit", "ground", "hub")
        .marker("tracker", "hub")
        .sense_marker("orientation", "tracker", "orientation")
        .sense_marker("gyro", "tracker", "angular_velocity", frame="marker")
        .point_mass(
            "slosh", "hub", mass=20.0, directions=[(1, 0, 0), (0, 1, 0)], offset=(0.2, 0.0, -0.3),
            coordinates=[fm.LinearCoordinate(stiffness_N_m=8.0, damping_Ns_m=0.5)] * 2,
        )
    )  # fmt: skip
    for i, axis in enumerate(np.eye(3)):
        builder.wheel(
            f"wheel {i}", "hub", axis=axis, mass=3.0, axial_inertia=0.1, transverse_inertia=0.06,
            torque=fm.ControlSignal(source=f"attitude[{i}]", gain=-1.0),
        )  # fmt: skip
    for side, name in ((1.0, "left"), (-1.0, "right")):
        builder.beam(name, length=4.0, elements=8, section=SECTION, modes=MODES)
        builder.revolute(
            f"{name} hinge", "hub", name, angle=-folded * side, stiffness=6.0, damping=4.0,
            parent_position=(0.0, 0.6 * side, 0.0), parent_quaternion=(np.sqrt(0.5), 0.0, 0.0, side * np.sqrt(0.5)),
        )  # fmt: skip
    return builder


def test_a_hundred_seconds_balance() -> None:
    builder = satellite(folded=1.2)
    builder.sense_profile("slew", fm.SmoothStep(start_value=0.0, end_value=0.8, start_s=5.0, duration_s=50.0))
    builder.user_law(
        "attitude", ["orientation", "gyro", "slew"], "flexmb.control.attitude:eigenaxis_slew", outputs=3,
        parameters=[0.0, 0.0, 1.0, *STIFFNESS, *DAMPING], period=PERIOD, delay=DELAY,
    )  # fmt: skip
    run = fm.simulate(builder.scene(), 100.0)
    assert np.abs(run.energy_drift).max() < 1e-9 * run.energy_scale
    assert np.abs(run.momentum).max() < 1e-10
    w, _, _, z = run.markers["tracker"].quaternion[-1]
    assert abs(2.0 * np.arctan2(z, w) - 0.8) < 1e-3  # of 0.8 rad: the slosh decays by exp(-0.0125 t) and still moves it


def test_its_linear_model_predicts_the_sampled_loop() -> None:
    """To 1e-6 of a motion that is so small that its squares are less: the discrete system of the open loop's model."""
    size, t_end = 1e-7, 6.0
    builder = satellite(folded=0.0)
    # for small angles the vector part of the quaternion is half the rotation vector
    gains = np.hstack([-2.0 * np.diag(STIFFNESS), -np.diag(DAMPING)])
    builder.state_space(
        "attitude", ["orientation[1]", "orientation[2]", "orientation[3]", "gyro"], D=gains, period=PERIOD, delay=DELAY
    )
    scene = builder.scene()
    model = fm.linearize(fm.open_loop(scene))
    names = [name for name, _ in model.states]
    inputs = [name for name, _ in model.inputs]
    B = -model.B[:, [inputs.index(f"wheel {i}.angle") for i in range(3)]]
    turned = [names.index(f"orbit.rotation.{axis}") for axis in "xyz"]
    turning = [names.index(f"orbit.angular_velocity.{axis}") for axis in "xyz"]
    whole = np.block([[model.A, B], [np.zeros((3, len(names) + 3))]])
    steps = [expm(length * whole) for length in (DELAY, PERIOD - DELAY)]
    start = size * np.array([0.5, -0.7, 0.4])
    x, torque = np.zeros(len(names)), np.zeros(3)
    x[turned] = start
    for _ in range(round(t_end / PERIOD)):
        new = -STIFFNESS * x[turned] - DAMPING * x[turning]
        for step, held in zip(steps, (torque, new), strict=True):
            x = (step @ [*x, *held])[: len(names)]
        torque = new
    run = fm.simulate(
        scene, t_end, samples=2, rtol=1e-12, atol=1e-17, state={"orbit": [0.0, 0.0, 0.0, 1.0, *0.5 * start]}
    )
    found: Any = 2.0 * run.markers["tracker"].quaternion[-1, 1:]
    assert np.abs(found - x[turned]).max() < 1e-6 * size
    assert np.abs(x[turned]).max() > 0.01 * size


AXIS = np.array([1.0, 2.0, 2.0]) / 3.0
ANGLE, DURATION = 1.2, 40.0
HUB = np.array([80.0, 90.0, 100.0])
FREQUENCY = 0.6  # rad/s, of the loop


def craft(law: str = "flexmb.control.attitude:eigenaxis_slew") -> fm.SceneBuilder:
    """Three wheels along body axes, and a slew by the profile."""
    builder = (
        fm.SceneBuilder("craft")
        .rigid_body("hub", mass=100.0, inertia=HUB)
        .free("orbit", "ground", "hub")
        .marker("star tracker", "hub")
        .sense_marker("orientation", "star tracker", "orientation")
        .sense_marker("gyro", "star tracker", "angular_velocity", frame="marker")
        .sense_profile("slew", fm.SmoothStep(start_value=0.0, end_value=ANGLE, start_s=5.0, duration_s=DURATION))
        .user_law(
            "attitude", ["orientation", "gyro", "slew"], law, outputs=3, period=0.1, delay=0.05,
            parameters=[*AXIS, *HUB * FREQUENCY**2, *1.4 * HUB * FREQUENCY],
        )
    )  # fmt: skip
    for i, axis in enumerate(np.eye(3)):
        builder.wheel(
            f"wheel {i}", "hub", axis=axis, mass=2.0, axial_inertia=0.1, transverse_inertia=0.06,
            torque=fm.ControlSignal(source=f"attitude[{i}]", gain=-1.0),
        )  # fmt: skip
    return builder


def test_the_craft_follows_the_slew_and_rests() -> None:
    run = fm.simulate(craft().scene(), 80.0)
    turned = np.array([np.cos(ANGLE / 2), *np.sin(ANGLE / 2) * AXIS])
    assert abs(run.markers["star tracker"].quaternion[-1] @ turned) == pytest.approx(1.0, abs=1e-9)
    assert np.abs(run.signals["gyro"][-1]).max() < 1e-5
    assert np.abs(run.momentum).max() < 1e-10  # wheels alone turn it
    assert np.abs(run.energy_drift).max() < 1e-9 * run.energy_scale
    rates = run.signals["gyro"] @ AXIS
    peak = 35.0 / 16.0 * ANGLE / DURATION
    assert rates.max() == pytest.approx(peak, rel=0.05)  # it runs after the profile
    along = np.linalg.norm(run.signals["gyro"] - np.outer(rates, AXIS), axis=1)
    assert along.max() < 0.02 * peak  # it turns about the axis, and hardly about others


def gyrostat(t: float, y: Any, motor: Any) -> Any:
    """Euler's equations of a body with three wheels: y = [quaternion, angular velocity, momenta of the wheels along
    their axes, of which the body's turning is a part]."""
    q, w, h = y[:4], y[4:7], y[7:]
    inertia = HUB + 2 * 0.06  # the wheels' transverse one, of the two that do not spin about the axis
    rate = -motor - np.cross(w, inertia * w + h)
    turning = 0.5 * np.array([-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))])
    return np.concatenate([turning, rate / inertia, motor])


def test_an_integration_of_its_own_agrees() -> None:
    """The same law on Euler's equations, by SciPy, from instant to instant."""
    t_end, period, delay, y = 12.0, 0.1, 0.05, np.array([1.0, *np.zeros(9)])
    slew = fm.SmoothStep(start_value=0.0, end_value=ANGLE, start_s=5.0, duration_s=DURATION)
    parameters, torque, none = np.array([*AXIS, *HUB * FREQUENCY**2, *1.4 * HUB * FREQUENCY]), np.zeros(3), []
    for k in range(round(t_end / period)):
        x = max(0.0, (k * period - slew.start_s) / slew.duration_s)
        angle = ANGLE * x**4 * (35 + x * (-84 + x * (70 - 20 * x)))
        rate = ANGLE / DURATION * 140 * (x * (1 - x)) ** 3
        new = np.zeros(3)
        eigenaxis_slew.py_func(k * period, np.array([*y[:7], angle, rate]), none, parameters, new, none)
        for length, held in ((delay, torque), (period - delay, new)):
            y = solve_ivp(gyrostat, (0.0, length), y, "DOP853", args=(-held,), rtol=1e-11, atol=1e-13).y[:, -1]
        torque = new
    run = fm.simulate(craft().scene(), t_end)
    seen = run.markers["star tracker"].quaternion[-1]
    assert seen * np.sign(seen[0]) == pytest.approx(y[:4] / np.linalg.norm(y[:4]), abs=1e-9)
    assert run.signals["gyro"][-1] == pytest.approx(y[4:7], abs=1e-10)
    assert np.abs(y[1:4]).max() > 0.001  # it has begun to turn


def test_the_law_is_the_small_angle_law_near_its_aim() -> None:
    """-k theta - d (w - rate n) for a small rotation from the profile, whatever the sign of the quaternion."""
    k, d, theta, w, angle, rate = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]), 1e-7, 0.3, 0.9, 0.2
    c, s = np.cos(angle / 2), np.sin(angle / 2) * AXIS
    small = theta * np.array([0.6, -0.8, 0.5])
    q = np.array([c - s @ small / 2, *(s + c * small / 2 + np.cross(s, small / 2))])
    speed = w * np.array([0.1, 0.2, -0.3])
    for sign in (1.0, -1.0):
        out, none, numbers = np.zeros(3), np.zeros(0), np.array([*AXIS, *k, *d])
        eigenaxis_slew(0.0, np.array([*sign * q, *speed, angle, rate]), none, numbers, out, none)
        assert out == pytest.approx(-k * small - d * (speed - rate * AXIS), abs=1e-13)
