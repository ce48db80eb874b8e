"""Where every body, inertia point and site is along a motion, as jets in World axes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexmb.dense.jets import Frame, Jet, constant, product, rotation_about, rotation_exponential, skew, stack, turn
from flexmb.dense.tree import Member, Rotor, Seat, Tree
from flexmb.scene import schema as s

Array = NDArray[np.float64]
AXES = dict(zip("xyz", np.eye(3), strict=True))


class Motion(NamedTuple):
    """Coordinates q (nq,), speeds u (nu,), and rates of the speeds (nu,)."""

    q: Array
    u: Array
    rates: Array


class Points(NamedTuple):
    """All P inertia points: mass (P,), inertia (P,3,3) about the mass centre in point axes, their member (P,)."""

    mass: Array
    inertia: Array
    member: NDArray[np.int64]


def points(tree: Tree) -> Points:
    """The inertia points of all members, then those of the wheels."""
    models, rotors = [member.model for member in tree.members], tree.rotors
    counts = [len(model.mass) for model in models]
    return Points(
        np.concatenate([*(model.mass for model in models), np.array([r.wheel.mass_kg for r in rotors])]),
        np.concatenate([*(model.inertia for model in models), *(r.inertia[None] for r in rotors)]),
        np.concatenate([np.repeat(np.arange(len(models)), counts), np.array([r.member for r in rotors], dtype=int)]),
    )


def member_frames(tree: Tree, motion: Motion) -> list[Frame]:
    """Body frames in World, base to tip: World -> inboard seat -> hinge -> back through the outboard seat."""
    frames: list[Frame] = []
    for member in tree.members:
        inboard = seat_frame(tree, frames, member.parent, member.inboard, motion)
        outboard = inboard.carry(hinge_frame(member, motion))
        frames.append(outboard.carry(_on_body(member.outboard, _eta(member, motion)).inverse()))
    return frames


def hinge_point(tree: Tree, frames: list[Frame], k: int, motion: Motion) -> Frame:
    """Outboard hinge frame of member k in World."""
    return seat_frame(tree, frames, k, tree.members[k].outboard, motion)


def seat_frame(tree: Tree, frames: list[Frame], k: int, seat: Seat, motion: Motion) -> Frame:
    """A seat on member k (-1: ground) in World."""
    if k < 0:
        return _on_body(seat, constant(np.zeros(0)))
    return frames[k].carry(_on_body(seat, _eta(tree.members[k], motion)))


def point_frames(tree: Tree, frames: list[Frame], motion: Motion) -> Frame:
    """Mass centres and axes of all inertia points in World, in the order of `points`."""
    found = [frame.carry(_field(member, motion)) for frame, member in zip(frames, tree.members, strict=True)]
    for rotor in tree.rotors:
        wheel = seat_frame(tree, frames, rotor.member, rotor.seat, motion).carry(_spin(rotor, motion))
        found.append(Frame(wheel.position[None], wheel.rotation[None]))
    return Frame(stack([f.position for f in found]), stack([f.rotation for f in found]))


def hinge_frame(member: Member, motion: Motion) -> Frame:
    """Outboard hinge frame seen from the inboard one."""
    q, u, rates = motion.q[member.q_hinge], motion.u[member.u_hinge], motion.rates[member.u_hinge]
    match member.hinge:
        case s.Spherical():
            return Frame(constant(np.zeros(3)), _attitude(q, u, rates))
        case s.Free():
            rotation = _attitude(q[3:], u[:3], rates[:3])
            R, v = rotation.value, u[3:]
            return Frame(Jet(q[:3], R @ v, R @ (np.cross(u[:3], v) + rates[3:])), rotation)
    c = Jet(q, u, rates)
    match member.hinge:
        case s.Revolute(axis=axis):
            return _rotated((axis, c[0]))
        case s.Prismatic(axis=axis):
            return _moved((axis, c[0]))
        case s.Cylindrical(axis=axis):
            return _moved((axis, c[1])).carry(_rotated((axis, c[0])))
        case s.Universal():
            return _rotated((AXES["x"], c[0]), (AXES["y"], c[1]))
        case s.Gimbal(sequence=sequence):
            return _rotated(*((AXES[axis], c[n]) for n, axis in enumerate(sequence)))
        case s.Planar():
            return _moved((AXES["x"], c[0]), (AXES["y"], c[1])).carry(_rotated((AXES["z"], c[2])))
        case s.PointMass(directions=directions):
            return _moved(*((direction, c[n]) for n, direction in enumerate(directions)))
    return _rotated()


def _rotated(*turns: tuple[ArrayLike, Jet]) -> Frame:
    """Successive rotations about carried axes."""
    rotation = constant(np.eye(3))
    for axis, angle in turns:
        rotation = rotation @ rotation_about(axis, angle)
    return Frame(constant(np.zeros(3)), rotation)


def _moved(*steps: tuple[ArrayLike, Jet]) -> Frame:
    """A sum of translations along fixed axes."""
    position = constant(np.zeros(3))
    for axis, distance in steps:
        position = position + product(np.multiply, constant(axis), distance)
    return Frame(position, constant(np.eye(3)))


def _attitude(quaternion: Array, w: Array, w_rate: Array) -> Jet:
    """R of a scalar-first quaternion with angular velocity w in turning axes: R' = R w~, R'' = R (w~ w~ + dw/dt~)."""
    q0, qv = quaternion[0], quaternion[1:]
    R = ((q0 * q0 - qv @ qv) * np.eye(3) + 2.0 * np.outer(qv, qv) + 2.0 * q0 * skew(qv)) / (quaternion @ quaternion)
    return Jet(R, R @ skew(w), R @ (skew(w) @ skew(w) + skew(w_rate)))


def _spin(rotor: Rotor, motion: Motion) -> Frame:
    angle = Jet(*(np.array(x) for x in (motion.q[rotor.q], motion.u[rotor.u], motion.rates[rotor.u])))
    return _rotated((rotor.wheel.axis, angle))


def _eta(member: Member, motion: Motion) -> Jet:
    return Jet(motion.q[member.q_modes], motion.u[member.u_modes], motion.rates[member.u_modes])


def _on_body(seat: Seat, eta: Jet) -> Frame:
    """A seat seen from its body: the node at x + phi eta, turned by exp((psi eta)~), then the fixed offset."""
    node = seat.node
    moved = constant(node.position) + eta.map(lambda x: node.translation @ x)
    turned = rotation_exponential(eta.map(lambda x: node.rotation_modes @ x)) @ constant(node.rotation)
    return Frame(moved, turned).carry(Frame(constant(seat.offset), constant(seat.rotation)))


def _field(member: Member, motion: Motion) -> Frame:
    """Mass centres and axes of a member's inertia points seen from its body."""
    model, eta = member.model, _eta(member, motion)
    rotation = rotation_exponential(eta.map(lambda x: model.rotation @ x))
    point = constant(model.position) + eta.map(lambda x: model.translation @ x)
    return Frame(point + turn(rotation, constant(model.com_offset)), rotation)
