"""Contiguous bodies seen from each other, from the exact jets of the dense route.

The frame of a body stands at its hinge point, as in the paper: at its outboard hinge frame, unless the modes of the
body move that frame; then it is the frame the body's data are written in.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.dense.body_frames import Motions, member_frames, on_body, point_frames
from flexmb.dense.jets import Jet, MovingFrame, constant
from flexmb.dense.members import DenseTree, Member

WORLD = MovingFrame(constant(np.zeros((1, 1, 3))), constant(np.eye(3)[None, None]))


def hinge_point(member: Member) -> MovingFrame:
    """The hinge point seen from the frame of the body's data, (1,1,...)."""
    node = member.outboard.node
    if np.any(node.translation) or np.any(node.rotation_modes):
        return WORLD
    return on_body(member.outboard, constant(np.zeros((1, 1, len(member.model.stiffness)))))


def hinge_frames(tree: DenseTree, motion: Motions) -> list[MovingFrame]:
    """Frames of all bodies at their hinge points, in World, base to tip."""
    found = member_frames(tree, motion)
    return [frame.carry(hinge_point(member)) for frame, member in zip(found, tree.members, strict=True)]


class Seen(NamedTuple):
    """A frame seen from another along B motions, World axes: position (3,), else (B,3); derivatives are those the
    other sees."""

    position: np.ndarray
    rate: np.ndarray
    acceleration: np.ndarray
    angular_rate: np.ndarray
    angular_acceleration: np.ndarray


def seen_from(frame: MovingFrame, inner: MovingFrame, motions: int) -> Seen:
    """`inner` seen from `frame`, both given in World."""
    relative = frame.inverse().carry(inner)
    R = frame.rotation.value[0, 0]

    def along(x: np.ndarray) -> np.ndarray:
        return np.broadcast_to(x, (motions, 1, 3))[:, 0] @ R.T

    p = relative.position
    return Seen(
        R @ p.value[0, 0], along(p.rate), along(p.acceleration),
        along(relative.angular_velocity()), along(relative.angular_acceleration()),
    )  # fmt: skip


class Expanded(NamedTuple):
    """Exact expanded velocities and their rates (B,nx) along B motions, in the rows of `RelativeMotion`.

    Rates of the bodies' angular rates are inertial, all others those the inboard body sees.
    """

    beta: np.ndarray
    velocities: np.ndarray
    rates: np.ndarray


def expanded(tree: DenseTree, motion: Motions) -> Expanded:
    """All contiguous bodies and wheels, from second-order jets of their frames."""
    count = len(motion.u)
    frames = hinge_frames(tree, motion)
    bodies, angular_rates = [], []
    for k, member in enumerate(tree.members):
        inboard = frames[member.parent] if member.parent >= 0 else WORLD
        seen = seen_from(inboard, frames[k], count)
        omega = np.broadcast_to(inboard.angular_velocity(), (count, 1, 3))[:, 0]
        bodies.append(seen)
        angular_rates.append(seen.angular_acceleration + np.cross(omega, seen.angular_rate))  # (119)
    turned = zip(tree.rotors, _wheel_frames(tree, motion), strict=True)
    wheels = [seen_from(frames[rotor.member], wheel, count) for rotor, wheel in turned]
    modes = np.concatenate([np.arange(x.u_modes.start, x.u_modes.stop) for x in tree.members])
    velocities = [x.angular_rate for x in bodies + wheels] + [motion.u[:, modes]] + [x.rate for x in bodies]
    rates = [*angular_rates, *(x.angular_acceleration for x in wheels), motion.rates[:, modes]]
    rates += [x.acceleration for x in bodies]
    return Expanded(np.array([x.position for x in bodies]), np.hstack(velocities), np.hstack(rates))


def _wheel_frames(tree: DenseTree, motion: Motions) -> list[MovingFrame]:
    """Frames of all wheels in World: the last of the inertia points."""
    points, first = point_frames(tree, member_frames(tree, motion), motion), -len(tree.rotors)

    def one(jet: Jet, i: int) -> Jet:
        return jet.map(lambda x: x[:, [first + i]])

    return [MovingFrame(one(points.position, i), one(points.rotation, i)) for i in range(len(tree.rotors))]
