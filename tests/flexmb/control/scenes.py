"""Scenes with sensors, and whatever controllers a test asks for."""

from __future__ import annotations

from typing import Any

import msgspec

import flexmb as fm
from tests.repo.project import ROOT

INERTIA = 0.8  # kg m^2, about the axis
STIFFNESS, DAMPING = 3.0, 0.4
SENSORS = (
    fm.CoordinateSensor(name="angle", of="pivot"),
    fm.CoordinateSensor(name="rate", of="pivot", quantity="rate"),
)


def rotor(*parts: Any, **hinge: Any) -> fm.Scene:
    """One body on one hinge without gravity: J theta'' = torque."""
    torque = fm.ControlSignal(source="law") if any(getattr(part, "name", "") == "law" for part in parts) else None
    return (
        fm.SceneBuilder("rotor")
        .rigid_body("disc", mass=1.0, com=(0.0, 0.0, 0.0), inertia=(1.0, 1.0, INERTIA))
        .revolute("pivot", "ground", "disc", angle=0.3, torque=torque, **hinge)
        .marker("rim", "disc", offset=(1.0, 0.0, 0.0))
        .add(*SENSORS, *parts)
        .scene()
    )


def pendulum(*parts: Any, **hinge: Any) -> fm.SceneBuilder:
    """A double pendulum whose first hinge may be driven."""
    return (
        fm.SceneBuilder("pendulum", gravity=(0.0, 0.0, -9.81))
        .rigid_body("upper", mass=1.0, com=(0.5, 0.0, 0.0), inertia=(0.01, 0.1, 0.1))
        .rigid_body("lower", mass=0.5, com=(0.4, 0.0, 0.0), inertia=(0.01, 0.05, 0.05))
        .revolute("pivot", "ground", "upper", axis=(0.0, 1.0, 0.0), angle=0.3, **hinge)
        .revolute("elbow", "upper", "lower", axis=(0.0, 1.0, 0.0), angle=0.5, parent_position=(1.0, 0.0, 0.0))
        .marker("end", "lower", offset=(0.8, 0.0, 0.0))
        .add(*SENSORS, *parts)
    )


def tossed(*parts: Any) -> fm.SceneBuilder:
    """A free body that tumbles, with a marker off its centre."""
    return (
        fm.SceneBuilder("tossed", gravity=(0.0, 0.0, -9.81))
        .rigid_body("hub", mass=2.0, inertia=(0.3, 0.5, 0.7))
        .free("float", "ground", "hub", angular_velocity=(0.4, -1.0, 2.0), velocity=(1.0, 0.5, 3.0))
        .marker("tip", "hub", offset=(0.3, -0.2, 0.5))
        .add(*parts)
    )


def driven_four_bar(**sampling: float) -> fm.Scene:
    """A four-bar whose crank a PID controller drives."""
    scene = fm.load_scene(ROOT / "cases" / "closed_chains" / "four_bar" / "scene.toml")
    crank = next(hinge for hinge in scene.hinges if hinge.name == "drive")
    turn = msgspec.structs.replace(crank.rotation, torque_Nm=fm.ControlSignal(source="servo", gain=0.8))
    hinges = [msgspec.structs.replace(each, rotation=turn) if each is crank else each for each in scene.hinges]
    sensors = (fm.CoordinateSensor(name="angle", of="drive"),)
    law = fm.Pid(name="servo", inputs=("angle",), kp=2.0, ki=3.0, **sampling)
    return msgspec.structs.replace(scene, hinges=tuple(hinges), sensors=sensors, controllers=(law,))
