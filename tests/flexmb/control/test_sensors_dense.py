"""Sensors of every kind, on a deforming body among connectors, against the dense route at one instant."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexmb as fm
from flexmb.dense import DenseSystem
from flexmb.scene.control import Sensor
from tests.bounds import UNIT_ROUNDOFF
from tests.flexmb.connectors.connected_scenes import between_bodies, bodies, waived

DIGITS = 2.0**12 * UNIT_ROUNDOFF  # poses of three bodies, accelerations and what they are differences of
MOTION = ("position", "orientation", "velocity", "angular_velocity", "acceleration", "angular_acceleration",
          "specific_force")  # fmt: skip


@pytest.fixture(scope="module")
def seen():
    """Signals (k,) at the start by sensor, and what the dense route says there: (scene, signals, q, u, udot, dense)."""
    builder = between_bodies(bodies(grounded=True)).rigid_body("arm", mass=0.4, com=(0.1, 0, 0), inertia=(1e-3,) * 3)
    drive = fm.Sine(amplitude=0.3, angular_frequency_rad_s=2.0, phase_rad=0.4)
    builder.revolute("driven", "hub", "arm", axis=(0, 1, 0), prescribed=drive)
    for quantity in MOTION:
        for frame in ("world", "marker"):
            builder.sense_marker(f"{quantity} {frame}", "tip", quantity, frame=frame)
    builder.sense_coordinate("elbow", "elbow").sense_coordinate("elbow rate", "elbow", quantity="rate")
    builder.sense_coordinate("bending", "boom.modes").sense_coordinate("flight rate", "flight", quantity="rate")
    builder.sense_distance("apart", "hub", "tip").sense_load("load", "elbow").sense_drive("drive", "driven.rotation")
    builder.sense_time("clock").sense_profile("wanted", drive)
    builder.state_space("law", "clock", D=((1.0,),), period=1.0)
    scene = waived(builder.scene())
    run = fm.simulate(scene, 1e-3, samples=2)
    dense = DenseSystem(scene)
    q, u = dense.on_profile(run.q[0], run.u[0], 0.0)
    rates = dense.accelerations(0.0, q, u)
    return scene, {name: signal[0] for name, signal in run.signals.items()}, q, u, rates, dense


def expected(quantity: str, frame: str, scene: fm.Scene, site) -> np.ndarray:
    R = site.rotation
    if quantity == "orientation":
        return np.roll(Rotation.from_matrix(R).as_quat(canonical=True), 1)
    found = {
        "position": site.position, "velocity": site.velocity[3:], "angular_velocity": site.velocity[:3],
        "acceleration": site.acceleration[3:], "angular_acceleration": site.acceleration[:3],
        "specific_force": site.acceleration[3:] - np.array(scene.gravity_m_s2),
    }[quantity]  # fmt: skip
    return R.T @ found if frame == "marker" else found


@pytest.mark.parametrize("frame", ["world", "marker"])
@pytest.mark.parametrize("quantity", MOTION)
def test_of_a_marker(seen, quantity: str, frame: str) -> None:
    scene, signals, q, u, rates, dense = seen
    right = expected(quantity, frame, scene, dense.markers(0.0, q, u, rates)["tip"])
    size = max(1.0, float(np.max(np.abs(rates))))
    assert np.max(np.abs(signals[f"{quantity} {frame}"] - right)) <= DIGITS * size


def test_of_distances_loads_drives_and_coordinates(seen) -> None:
    scene, signals, q, u, rates, dense = seen
    tip, hub = (dense.markers(0.0, q, u, rates)[name] for name in ("tip", "hub"))
    arm = tip.position - hub.position
    length = np.linalg.norm(arm)
    opening = arm @ (tip.velocity - hub.velocity)[3:] / length
    assert np.max(np.abs(signals["apart"] - [length, opening])) <= DIGITS
    system = fm.compile(scene)
    load = dense.hinge_loads(0.0, q, u, rates)["elbow"]
    assert np.max(np.abs(signals["load"] - load)) <= DIGITS * max(1.0, np.max(np.abs(load)))
    drive = dense.drives(0.0, q, u, rates)["driven"]
    assert np.max(np.abs(signals["drive"] - drive)) <= DIGITS * max(1.0, np.max(np.abs(drive)))
    assert np.abs(drive) > 1e-3
    for name, of in (("elbow", "elbow"), ("bending", "boom.modes")):
        assert np.array_equal(signals[name], q[system.coordinate(of)])
    for name, of in (("elbow rate", "elbow"), ("flight rate", "flight")):
        assert np.array_equal(signals[name], u[system.speed(of)])
    phase = 0.4
    assert signals["wanted"] == pytest.approx([0.3 * np.sin(phase), 0.6 * np.cos(phase)], abs=1e-15)
    assert signals["clock"] == 0.0


def test_every_kind_is_here(seen) -> None:
    assert {type(sensor) for sensor in seen[0].sensors} == set(get_args(Sensor))
