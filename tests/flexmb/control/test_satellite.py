"""A satellite with hinged flexible panels, wheels and slosh, under an attitude controller of 10 Hz, 50 ms late."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import expm

import flexmb as fm
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
