"""The scene's initial state: every body at the frame that its hinge gives it, from the ground outward."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from crosscheck.engines.conventions import axis_rotation, quaternion_of, rotation_matrix
from crosscheck.engines.kane.bodies import KaneBody
from crosscheck.engines.kane.frames import BodyFrames, FramePlace, FreeBodies
from crosscheck.engines.kane.joints import KaneFlight, KaneJoint
from flexmb.scene.schema import Scene
from flexmb.scene.tree import ordered
from flexmb.typing import Real


def start(
    scene: Scene,
    held: Sequence[KaneJoint | KaneFlight],
    numbers: Mapping[str, int],
    data: Mapping[str, KaneBody],
    modes: int,
) -> tuple[FreeBodies, Real]:
    """All bodies, wheels and the ground at t = 0, and their quaternions (b+1, 4)."""
    count = len(numbers)
    bodies = FreeBodies(
        np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)), np.zeros((count, 3)),
        np.zeros((count, modes)), np.zeros((count, modes)),
    )  # fmt: skip
    for given in scene.modal_states:
        number, size = numbers[given.body], len(given.coordinates)
        if len(data[given.body].stiffness):
            bodies.eta[number, :size] = given.coordinates
            bodies.rate[number, : len(given.rates)] = given.rates
    named = {each.of.name: each for each in held}
    for name in [*(hinge.name for _, hinge in ordered(scene)), *(wheel.name for wheel in scene.wheels)]:
        _place(bodies, named[name], modes)
    return bodies, np.array([quaternion_of(R) for R in bodies.rotation])


def _place(bodies: FreeBodies, joint: KaneJoint | KaneFlight, modes: int) -> None:
    """Put the outboard body where the joint holds it."""
    at = BodyFrames([joint.inboard], modes).at(bodies)
    position, axes, (w, v) = at.position[0], at.axes[0], at.velocity[0].reshape(2, 3)
    if isinstance(joint, KaneFlight):
        own = joint.of
        arm, turn = axes @ np.array(own.position_m), axes @ rotation_matrix(own.quaternion)
        v = v + np.cross(w, arm) + turn @ np.array(own.velocity_m_s)
        position, axes, w = position + arm, turn, w + turn @ np.array(own.angular_velocity_rad_s)
    else:
        angle, rate = joint.start
        w = w + rate * axes[:, 2]
        axes = axes @ axis_rotation(np.array([0.0, 0.0, 1.0]), angle)
    _carry(bodies, joint.outboard, modes, position, axes, w, v)


def _carry(bodies: FreeBodies, place: FramePlace, modes: int, position: Real, axes: Real, w: Real, v: Real) -> None:
    """Move the body so that its frame has this position, these axes and velocities, World axes."""
    number = place.body
    own = BodyFrames([place], modes).at(bodies)  # the body is still at the origin, at rest
    bodies.rotation[number] = axes @ own.axes[0].T
    R = bodies.rotation[number]
    bodies.position[number] = position - R @ own.position[0]
    spin, shift = (R @ part for part in own.velocity[0].reshape(2, 3))
    bodies.angular[number] = R.T @ (w - spin)
    bodies.velocity[number] = v - shift - np.cross(w - spin, R @ own.position[0])
