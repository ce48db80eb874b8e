"""What an invariance is: another scene of the same motion, and how its channels are told as those of the first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from flexmb.scene.bodies import BeamBody, ModalBody, Quaternion, RigidBody, SidBody, Vector
from flexmb.scene.schema import Scene
from flexmb.typing import Real

Channels = dict[str, Real]
POLAR = (".position", ".velocity", ".force", ".linear")
AXIAL = (".angular_velocity", ".torque", ".angular")


class NotApplicable(ValueError):
    """The invariance says nothing about this scene; the message says why."""


@dataclass(frozen=True)
class Counterpart:
    """A scene that moves like another. `back(times, channels)` tells its channels (T, k) as those of the other at the
    other's `times` (T,); what it leaves out is not compared. Its clock shows `clock` times as much, and `starts_s` (s)
    where the other's shows 0."""

    scene: Scene
    back: Callable[[Real, Channels], Channels]
    clock: float = 1.0
    starts_s: float = 0.0


@dataclass(frozen=True)
class Invariance:
    """A change that means nothing. `of` makes a scene's counterpart, or raises `NotApplicable`."""

    name: str
    what: str
    of: Callable[[Scene], Counterpart]


def without_feedback(scene: Scene) -> None:
    """`NotApplicable` for a scene with controllers, which the invariance would have to tell in its own terms."""
    if scene.controllers:
        raise NotApplicable("the scene has controllers, which would have to be told in the other frame too")


def without_events(scene: Scene) -> None:
    """`NotApplicable` for a scene with events, whose levels the invariance would have to tell in its own terms."""
    if scene.events:
        raise NotApplicable(f'event "{scene.events[0].name}" has a level, which is not told in other terms')


def by_kind(
    channels: Channels,
    polar: Callable[[Real], Real],
    axial: Callable[[Real], Real],
    orientation: Callable[[Real], Real],
) -> Channels:
    """Channels with their vectors and quaternions mapped, each after its kind; numbers as they are."""

    def mapped(name: str, values: Real) -> Real:
        if name.startswith(("drive:", "hinge_force:")):  # whatever it is called
            return values
        if name.endswith(".orientation"):
            return orientation(values)
        if name.endswith(AXIAL):
            return axial(values)
        return polar(values) if name.endswith(POLAR) else values

    return {name: mapped(name, values) for name, values in channels.items()}


def with_energy(channels: Channels, changes: dict[str, Real]) -> Channels:
    """Channels with (T,) added to kinds of energy, and to their total."""
    found = dict(channels)
    for kind, change in changes.items():
        if f"energy.{kind}" in found:
            found[f"energy.{kind}"] = found[f"energy.{kind}"] + change[:, None]
            found["energy.total"] = found["energy.total"] + change[:, None]
    return found


def product(a: Real, b: Real) -> Real:
    """Quaternions (4,) times (T,4): the rotation b, then a."""
    w, v = a[0], a[1:]
    scalar = w * b[:, 0] - b[:, 1:] @ v
    vector = w * b[:, 1:] + b[:, :1] * v + np.cross(v, b[:, 1:])
    return np.column_stack([scalar, vector])


def vector(values: Real) -> Vector:
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def quaternion(values: Real) -> Quaternion:
    w, x, y, z = (float(value) for value in values)
    return (w, x, y, z)


def total_mass(scene: Scene) -> float:
    """Mass of everything (kg); `NotApplicable` where a body keeps it in a file."""
    found = sum(wheel.mass_kg for wheel in scene.wheels) + sum(point.mass_kg for point in scene.point_masses)
    for body in scene.bodies:
        match body:
            case RigidBody():
                found += body.mass_kg
            case BeamBody():
                x, density = np.array([(each.x_m, each.mass_per_length_kg_m) for each in body.stations]).T
                found += float(np.trapezoid(density, x)) + sum(tip.mass_kg for tip in body.tip_masses)
            case ModalBody() if body.points:
                found += sum(point.mass_kg for point in body.points)
            case ModalBody() | SidBody():
                raise NotApplicable(f'body "{body.name}" keeps its mass in a file')
            case _:
                assert_never(body)
    return found
