"""Positions and velocities of all bodies at t = 0: redundant coordinates must satisfy the joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

import numpy as np

from crosscheck.engines.conventions import axis_rotation, rotation_matrix
from crosscheck.engines.exudyn.modal import NodeShape
from crosscheck.engines.exudyn.rotations import exponential, left_jacobian
from crosscheck.engines.functions_of_time import initial
from flexmb.scene.freedoms import Ball, Coordinate, Floating
from flexmb.typing import Real


@dataclass(frozen=True)
class FrameMotion:
    """A frame in World: `position` (3,) m, `rotation` (3,3) to World; `angular` rad/s, `linear` m/s in World axes."""

    position: Real
    rotation: Real
    angular: Real
    linear: Real

    def offset(self, position: Real, rotation: Real) -> FrameMotion:
        """A frame fixed in this one."""
        arm = self.rotation @ position
        return FrameMotion(
            self.position + arm, self.rotation @ rotation, self.angular, self.linear + np.cross(self.angular, arm)
        )

    def turned(self, axis: Real, angle: float, rate: float) -> FrameMotion:
        """This frame turned about its own unit `axis`."""
        spin = rate * (self.rotation @ axis)
        return FrameMotion(self.position, self.rotation @ axis_rotation(axis, angle), self.angular + spin, self.linear)

    def moved(self, displacement: Real, rate: Real) -> FrameMotion:
        """This frame displaced by a vector in its own axes that changes at `rate`."""
        arm = self.rotation @ displacement
        velocity = self.linear + np.cross(self.angular, arm) + self.rotation @ rate
        return FrameMotion(self.position + arm, self.rotation, self.angular, velocity)

    def spherical(self, quaternion: Real, rate: Real) -> FrameMotion:
        """This frame turned by `quaternion`, with the relative angular velocity `rate` in the turned axes."""
        rotation = self.rotation @ rotation_matrix(quaternion)
        return FrameMotion(self.position, rotation, self.angular + rotation @ rate, self.linear)

    def node(self, shape: NodeShape, eta: Real, rate: Real) -> FrameMotion:
        """A node of a flexible body whose frame this is; the node turns by exp(rotation_modes eta)."""
        theta, theta_rate = shape.rotation_modes @ eta, shape.rotation_modes @ rate
        moved = self.moved(shape.position + shape.translation @ eta, shape.translation @ rate)
        rotation = self.rotation @ exponential(theta) @ shape.rotation
        spin = self.rotation @ left_jacobian(theta) @ theta_rate
        return FrameMotion(moved.position, rotation, self.angular + spin, moved.linear)

    def body_of(self, node: FrameMotion) -> FrameMotion:
        """The body frame, where this is a node's motion and `node` the node's motion seen from the body frame."""
        rotation = self.rotation @ node.rotation.T
        angular = self.angular - rotation @ node.angular
        arm = rotation @ node.position
        linear = self.linear - np.cross(angular, arm) - rotation @ node.linear
        return FrameMotion(self.position - arm, rotation, angular, linear)


AT_REST = FrameMotion(np.zeros(3), np.eye(3), np.zeros(3), np.zeros(3))


def across(inboard: FrameMotion, axis: Real, coordinate: Coordinate) -> FrameMotion:
    """The frame beyond one scalar coordinate about or along `axis` (in the inboard frame)."""
    value, rate = initial(coordinate)
    return inboard.turned(axis, value, rate) if coordinate.ANGULAR else inboard.moved(value * axis, rate * axis)


def across_quaternion(inboard: FrameMotion, freedom: Ball | Floating) -> FrameMotion:
    """The frame beyond a freedom with a quaternion; the velocity of free flight is in the outboard axes."""
    match freedom:
        case Ball():
            moved = inboard
        case Floating(position=position, quaternion=quaternion, velocity=velocity):
            moved = inboard.moved(np.array(position), rotation_matrix(quaternion) @ np.array(velocity))
        case _:
            assert_never(freedom)
    return moved.spherical(freedom.quaternion, np.array(freedom.angular_velocity))
