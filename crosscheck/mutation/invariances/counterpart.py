"""An invariance: another scene with the same motion, and the transformation of its channels to those of the first."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from crosscheck.library.channels import LINEAR_KINDS
from crosscheck.mutation.invariances.linearised import Channels, LinearRelation
from flexmb.scene.bodies import Quaternion
from flexmb.scene.rigid_equivalent import total_mass
from flexmb.scene.schema import Scene
from flexmb.typing import Real

POLAR = (".position", ".velocity", ".force", ".linear")
AXIAL = (".angular_velocity", ".torque", ".angular")


class NotApplicable(ValueError):
    """The invariance does not hold for this scene, for the reason in the message."""


@dataclass(frozen=True)
class Counterpart:
    """A scene that moves like another. `back(times, channels)` transforms its channels (T, k) to those of the other at
    the other's `times` (T,); channels that it omits are not compared. `linear` does so for the linearised motion, which
    is not compared if it is None. Its clock is `clock` times as fast, and shows `starts_s` (s) where the other's shows
    0."""

    scene: Scene
    back: Callable[[Real, Channels], Channels]
    clock: float = 1.0
    starts_s: float = 0.0
    linear: LinearRelation | None = None

    def told(self, times: Real, channels: Channels) -> Channels:
        """All channels (T,k) of the counterpart in the terms of the scene, at the scene's times (T,)."""
        motion = {name: rows for name, rows in channels.items() if name.partition(".")[0] not in LINEAR_KINDS}
        return self.back(times, motion) | ({} if self.linear is None else self.linear.back(channels))


@dataclass(frozen=True)
class Invariance:
    """An invariance. `of` makes a scene's counterpart, or raises `NotApplicable`."""

    name: str
    what: str
    of: Callable[[Scene], Counterpart]


def without_feedback(scene: Scene) -> None:
    """`NotApplicable` for a scene with controllers, which the invariance does not transform."""
    if scene.controllers:
        raise NotApplicable("the scene has controllers, which would have to be told in the other frame too")


def without_events(scene: Scene) -> None:
    """`NotApplicable` for a scene with events, whose levels the invariance does not transform."""
    if scene.events:
        raise NotApplicable(f'event "{scene.events[0].name}" has a level, which is not told in other terms')


def by_kind(
    channels: Channels,
    polar: Callable[[Real], Real],
    axial: Callable[[Real], Real],
    orientation: Callable[[Real], Real],
) -> Channels:
    """Channels with their vectors and quaternions mapped by kind, and scalars unchanged."""

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
    changed = dict(channels)
    for kind, change in changes.items():
        if f"energy.{kind}" in changed:
            changed[f"energy.{kind}"] = changed[f"energy.{kind}"] + change[:, None]
            changed["energy.total"] = changed["energy.total"] + change[:, None]
    return changed


def product(a: Real, b: Real) -> Real:
    """Quaternions (4,) times (T,4): the rotation b, then a."""
    w, v = a[0], a[1:]
    scalar = w * b[:, 0] - b[:, 1:] @ v
    vector = w * b[:, 1:] + b[:, :1] * v + np.cross(v, b[:, 1:])
    return np.column_stack([scalar, vector])


def quaternion(values: Real) -> Quaternion:
    w, x, y, z = (float(value) for value in values)
    return (w, x, y, z)


def known_mass(scene: Scene) -> float:
    """The total mass (kg); `NotApplicable` if that of a body is in its SID file."""
    try:
        return total_mass(scene)
    except ValueError as error:
        raise NotApplicable(str(error)) from None
