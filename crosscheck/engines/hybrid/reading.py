"""What sensors read and events watch, from the state of a peer's tree."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import assert_never

import numpy as np

from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.conventions import rotation_matrix
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.hybrid.laws import Numbers
from crosscheck.engines.rigid_tree import Slot, TreeState, scalars
from flexmb.scene.schema import (
    CoordinateSensor,
    DistanceSensor,
    DriveSensor,
    LoadSensor,
    MarkerSensor,
    ProfileSensor,
    Scene,
    Sensor,
    TimeSensor,
)
from flexmb.scene.tree import coordinates

TIME = "time"
Seen = Callable[[], Snapshot]
"""Gives the snapshot of the state that is read; only what needs it asks for it."""
Reader = Callable[[float, TreeState, Seen], Numbers]


def coordinate_names(scene: Scene) -> dict[str, tuple[str, int]]:
    """The item and the number of every scalar coordinate by its name: "root.rotation", "wheel.angle"."""
    named = {f"{wheel.name}.angle": (wheel.name, 0) for wheel in scene.wheels}
    for item in (*scene.hinges, *scene.point_masses):
        named |= {f"{item.name}.{each.name}": (item.name, number) for number, each in enumerate(coordinates(item))}
    return named


def rate_names(scene: Scene) -> dict[str, str]:
    """The coordinate of every rate by its name: "root.rotation.rate", "wheel.speed"."""
    wheels = {wheel.name for wheel in scene.wheels}
    return {
        f"{item}.speed" if item in wheels else f"{name}.rate": name
        for name, (item, _) in coordinate_names(scene).items()
    }


def slot_of(scene: Scene, slots: Sequence[Slot], coordinate: str) -> Slot:
    """The slot of a scalar coordinate."""
    item, number = coordinate_names(scene)[coordinate]
    return [slot for slot in scalars(slots) if slot.link.joint == item][number]


@cache
def split(reference: str) -> tuple[str, int | None]:
    """A signal's name and number: "gyro[2]" is ("gyro", 2), "gyro" is ("gyro", None)."""
    name, bracket, number = reference.partition("[")
    return name, int(number.rstrip("]")) if bracket else None


def chosen(values: Mapping[str, Numbers], reference: str) -> Numbers:
    """The numbers that a reference names."""
    name, number = split(reference)
    return values[name] if number is None else [values[name][number]]


def sensor_reader(scene: Scene, slots: Sequence[Slot], sensor: Sensor) -> Reader:
    """What a sensor reads of positions, speeds and time; NotImplementedError for kinds that are refused."""
    match sensor:
        case CoordinateSensor(of=of, quantity=quantity):
            names = [name for name, (item, _) in coordinate_names(scene).items() if of in (name, item)]
            own = [slot_of(scene, slots, name) for name in names]
            if quantity == "rate":
                return lambda t, state, seen: [float(state.v[slot.v]) for slot in own]
            return lambda t, state, seen: [float(state.q[slot.q]) for slot in own]
        case MarkerSensor(marker=name):
            return lambda t, state, seen: _of_marker(sensor, seen().markers[name])
        case DistanceSensor(marker_a=a, marker_b=b):
            return lambda t, state, seen: _distance(seen().markers[a], seen().markers[b])
        case TimeSensor():
            return lambda t, state, seen: [t]
        case ProfileSensor(function=function):
            course = profile(function)
            return lambda t, state, seen: list(course(t)[:2])
        case LoadSensor() | DriveSensor():
            raise NotImplementedError(f'sensor "{sensor.name}", which `refusal` refuses, has reached the loop')
        case _:
            assert_never(sensor)


def _of_marker(sensor: MarkerSensor, marker: MarkerSnapshot) -> Numbers:
    match sensor.quantity:
        case "orientation":
            return [float(each) for each in np.copysign(1.0, marker.quaternion[0]) * marker.quaternion]
        case "position":
            vector = marker.position
        case "velocity":
            vector = marker.velocity[3:]
        case "angular_velocity":
            vector = marker.velocity[:3]
        case "acceleration" | "angular_acceleration" | "specific_force":
            raise NotImplementedError(f'sensor "{sensor.name}", which `refusal` refuses, has reached the loop')
        case _:
            assert_never(sensor.quantity)
    own = rotation_matrix(marker.quaternion).T if sensor.frame == "marker" else np.eye(3)
    return [float(each) for each in own @ vector]


def _distance(a: MarkerSnapshot, b: MarkerSnapshot) -> Numbers:
    arm, moving = b.position - a.position, b.velocity[3:] - a.velocity[3:]
    length = float(np.linalg.norm(arm))
    return [length, float(arm @ moving) / length]
