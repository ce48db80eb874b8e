"""Where the markers of a scene of rigid bodies are, from the coordinates and speeds of its hinges.

A model that gives an angle and its rate, and no more, can so be compared in all that its bodies do.
"""

from __future__ import annotations

from typing import NamedTuple, assert_never

import numpy as np

from crosscheck.engines.contract import MarkerPath
from crosscheck.engines.conventions import Frame, axis_rotation, cross, quaternion_of, rotation_matrix
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.links import Ball, Floating, Freedom, Link, Scalar, attachment, links
from crosscheck.engines.trajectories import continuous
from flexmb.scene.schema import Scene
from flexmb.scene.tree import coordinates
from flexmb.typing import Real

XYZ, WXYZ = "xyz", "wxyz"


class FrameInMotion(NamedTuple):
    """A frame in World axes: position (3,), rotation (3,3), angular and linear velocity (3,) of its origin."""

    position: Real
    rotation: Real
    angular: Real
    linear: Real

    def carrying(self, inner: Frame) -> FrameInMotion:
        """A frame fixed in this one."""
        arm = self.rotation @ inner.position
        return FrameInMotion(
            self.position + arm, self.rotation @ inner.rotation, self.angular, self.linear + cross(self.angular, arm)
        )

    def turned(self, rotation: Real, angular: Real) -> FrameInMotion:
        """After a turn, with its rate in the axes of this frame."""
        return self._replace(rotation=self.rotation @ rotation, angular=self.angular + self.rotation @ angular)

    def shifted(self, by: Real, rate: Real) -> FrameInMotion:
        """After a shift, with its rate, both in the axes of this frame."""
        arm = self.rotation @ by
        return self._replace(
            position=self.position + arm,
            linear=self.linear + cross(self.angular, arm) + self.rotation @ rate,
        )


class Kinematics:
    """The markers of a scene of rigid bodies."""

    def __init__(self, scene: Scene) -> None:
        self._links = links(scene)
        self._places = {marker.name: attachment(scene, self._links, marker) for marker in scene.markers}
        items = (*scene.hinges, *scene.point_masses)
        self._keys = {item.name: [f"{item.name}.{name}" for name, _ in coordinates(item)] for item in items}
        self._wheels = {wheel.name for wheel in scene.wheels}

    def paths(self, times: Real, columns: dict[str, Real]) -> dict[str, MarkerPath]:
        """Motions of all markers by name; columns (T,): coordinates and speeds by their names in states, without those
        that a function of time prescribes."""
        seen: dict[str, list[FrameInMotion]] = {name: [] for name in self._places}
        for row, t in enumerate(times):
            values = {name: float(column[row]) for name, column in columns.items()}
            frames = self._frames(float(t), values)
            for name, at in self._places.items():
                seen[name].append(frames[at.link].carrying(at.frame))
        return {
            name: MarkerPath(
                np.array([each.position for each in motion]),
                continuous(np.array([quaternion_of(each.rotation) for each in motion])),
                np.array([np.concatenate([each.angular, each.linear]) for each in motion]),
            )
            for name, motion in seen.items()
        }

    def _frames(self, t: float, values: dict[str, float]) -> list[FrameInMotion]:
        frames: list[FrameInMotion] = []
        for link in self._links:
            at = STILL if link.parent < 0 else frames[link.parent]
            at = at.carrying(link.inboard)
            number = 0
            for freedom in link.freedoms:
                at = self._through(at, link, freedom, number, t, values)
                number += isinstance(freedom, Scalar)
            frames.append(at)
        return frames

    def _through(
        self, at: FrameInMotion, link: Link, freedom: Freedom, number: int, t: float, values: dict[str, float]
    ) -> FrameInMotion:
        match freedom:
            case Scalar():
                value, rate = self._scalar(link, freedom, number, t, values)
                axis = freedom.axis
                match freedom.motion:
                    case "turn":
                        return at.turned(axis_rotation(axis, value), rate * axis)
                    case "slide":
                        return at.shifted(value * axis, rate * axis)
                    case "screw":
                        moved = at.shifted(freedom.pitch * value * axis, freedom.pitch * rate * axis)
                        return moved.turned(axis_rotation(axis, value), rate * axis)
                    case _:
                        assert_never(freedom.motion)
            case Ball():
                turn, angular = _attitude(link.joint, values)
                return at.turned(turn, turn @ angular)
            case Floating():
                turn, angular = _attitude(link.joint, values)
                place, speed = (
                    np.array([values[f"{link.joint}.{key}.{axis}"] for axis in XYZ]) for key in ("position", "velocity")
                )
                return at.shifted(place, turn @ speed).turned(turn, turn @ angular)
            case _:
                assert_never(freedom)

    def _scalar(
        self, link: Link, freedom: Scalar, number: int, t: float, values: dict[str, float]
    ) -> tuple[float, float]:
        if freedom.prescribed is not None:
            motion = profile(freedom.prescribed)(t)
            return float(motion[0]), float(motion[1])
        if link.joint in self._wheels:
            return values[f"{link.joint}.angle"], values[f"{link.joint}.speed"]
        name = self._keys[link.joint][number]
        return values[name], values[f"{name}.rate"]


STILL = FrameInMotion(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))


def _attitude(joint: str, values: dict[str, float]) -> tuple[Real, Real]:
    """Rotation (3,3) of a ball joint or free flight, and angular velocity (3,) in outboard axes."""
    quaternion = np.array([values[f"{joint}.quaternion.{axis}"] for axis in WXYZ])
    turn = rotation_matrix(quaternion / np.linalg.norm(quaternion))
    return turn, np.array([values[f"{joint}.angular_velocity.{axis}"] for axis in XYZ])
