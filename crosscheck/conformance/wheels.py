"""Wheels: reactions of their motors on their body, and loads of their bearings."""

from __future__ import annotations

from typing import Any

import numpy as np

from crosscheck.conformance.clause import Chapter, acceleration, equal, given, snapshot
from crosscheck.conformance.scenes import DOWN, G, hub
from crosscheck.engines.contract import Engine
from flexmb.scene.build import SceneBuilder
from flexmb.scene.functions import Constant, Ramp, Sine

WHEELS = Chapter(physical=True)
WHEEL: dict[str, Any] = {"axis": (0.0, 0.0, 1.0), "mass": 0.5, "axial_inertia": 0.04, "transverse_inertia": 0.025}


@WHEELS.clause("A wheel's motor reacts on its body; `wheel_loads` act on the wheel about its centre.")
def wheel_motor_reacts_on_its_body(engine: Engine) -> None:
    spun = hub().free("free", "ground", "hub")
    scene = spun.wheel("wheel", "hub", **WHEEL, torque=Constant(value=0.6), speed=10.0, friction=0.01).scene()
    answer = snapshot(engine, scene)
    torque = 0.6 - 0.01 * 10.0
    equal("the acceleration of the hub", acceleration(answer, "hub"), [0, 0, -torque / 1.5, 0, 0, 0])
    load = given("the load of a wheel", answer.wheel_loads.get("wheel"))
    equal("the load of the wheel", load, [0, 0, torque, 0, 0, 0])


@WHEELS.clause("A spinning wheel needs a gyroscopic bearing torque.")
def spinning_wheel_needs_a_gyroscopic_torque(engine: Engine) -> None:
    """Precession at w about x of a wheel with spin s about z: torque on the wheel w x (J s z) = -w J s y."""
    scene = (
        SceneBuilder("precession", gravity=DOWN)
        .rigid_body("yoke", mass=5.0, inertia=(1.0, 1.2, 1.5))
        .revolute("drive", "ground", "yoke", axis=(1.0, 0.0, 0.0), prescribed=Ramp(rate=0.5))
        .wheel("wheel", "yoke", **WHEEL, speed=100.0)
        .scene()
    )
    answer = snapshot(engine, scene)
    torque = -0.5 * 0.04 * 100.0
    wheel = given("the load of a wheel", answer.wheel_loads.get("wheel"))
    equal("the load of the wheel", wheel, [0, torque, 0, 0, 0, 0.5 * G])
    equal("the torque across the drive", given("the load", answer.loads.get("drive"))[:3], [0, torque, 0])


@WHEELS.clause("The drive load of a prescribed wheel is the torque that its motion needs, friction included.")
def prescribed_wheel_reports_its_drive_torque(engine: Engine) -> None:
    wave = Sine(amplitude=0.4, angular_frequency_rad_s=2.0, phase_rad=0.7)
    scene = hub().weld("weld", "ground", "hub").wheel("wheel", "hub", **WHEEL, prescribed=wave, friction=0.1).scene()
    answer = snapshot(engine, scene)
    rate, alpha = 0.8 * np.cos(0.7), -1.6 * np.sin(0.7)
    equal("the drive torque", given("drive loads", answer.drives.get("wheel")), [0.04 * alpha + 0.1 * rate])
    equal("the torque across the weld", given("the load", answer.loads.get("weld"))[2], 0.04 * alpha)
