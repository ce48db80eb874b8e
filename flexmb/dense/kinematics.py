"""Where every body, inertia point and site is along a motion, as jets in World axes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexmb.dense.jets import (
    Frame,
    Jet,
    constant,
    join,
    product,
    quadratic,
    rotation_about,
    rotation_exponential,
    skew,
    turn,
)
from flexmb.dense.tree import Member, Rotor, Seat, Tree
from flexmb.scene import schema as s
from flexmb.typing import Real

AXES = dict(zip("xyz", np.eye(3), strict=True))


class Motion(NamedTuple):
    """B motions from one configuration: coordinates q (nq,), speeds u (B,nu), rates of the speeds (B,nu)."""

    q: Real
    u: Real
    rates: Real

    def hinge(self, member: Member) -> Jet:
        """Coordinates of a hinge whose speeds are their rates, (B,1,n)."""
        return self._part(member.q_hinge, member.u_hinge)

    def modes(self, member: Member) -> Jet:
        """eta, (B,1,m)."""
        return self._part(member.q_modes, member.u_modes)

    def spin(self, rotor: Rotor) -> Jet:
        """Angle of a wheel, (B,1)."""
        return self._part(slice(rotor.q, rotor.q + 1), slice(rotor.u, rotor.u + 1))[..., 0]

    def _part(self, q: slice, u: slice) -> Jet:
        return Jet(self.q[None, None, q], self.u[:, None, u], self.rates[:, None, u])


class Points(NamedTuple):
    """All P inertia points: mass (P,), inertia (P,3,3) about the mass centre in point axes, their member (P,)."""

    mass: Real
    inertia: Real
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
        frames.append(outboard.carry(on_body(member.outboard, motion.modes(member)).inverse()))
    return frames


def seat_frame(tree: Tree, frames: list[Frame], k: int, seat: Seat, motion: Motion) -> Frame:
    """A seat on member k (-1: ground) in World."""
    if k < 0:
        return on_body(seat, constant(np.zeros((1, 1, 0))))
    return frames[k].carry(on_body(seat, motion.modes(tree.members[k])))


def point_frames(tree: Tree, frames: list[Frame], motion: Motion) -> Frame:
    """Mass centres and axes of all inertia points in World, in the order of `points`."""
    found = [frame.carry(field(member, motion)) for frame, member in zip(frames, tree.members, strict=True)]
    for rotor in tree.rotors:
        spin = _rotated((rotor.wheel.axis, motion.spin(rotor)))
        found.append(seat_frame(tree, frames, rotor.member, rotor.seat, motion).carry(spin))
    count = len(motion.u)
    return Frame(join([f.position for f in found], count), join([f.rotation for f in found], count))


def hinge_frame(member: Member, motion: Motion) -> Frame:
    """Outboard hinge frame seen from the inboard one."""
    c = motion.hinge(member)
    match member.hinge:
        case s.Revolute(axis=axis):
            return _rotated((axis, c[..., 0]))
        case s.Prismatic(axis=axis):
            return _moved((axis, c[..., 0]))
        case s.Cylindrical(axis=axis):
            return _moved((axis, c[..., 1])).carry(_rotated((axis, c[..., 0])))
        case s.Universal():
            return _rotated((AXES["x"], c[..., 0]), (AXES["y"], c[..., 1]))
        case s.Gimbal(sequence=sequence):
            return _rotated(*((AXES[axis], c[..., n]) for n, axis in enumerate(sequence)))
        case s.Planar():
            return _moved((AXES["x"], c[..., 0]), (AXES["y"], c[..., 1])).carry(_rotated((AXES["z"], c[..., 2])))
        case s.PointMass(directions=directions):
            return _moved(*((direction, c[..., n]) for n, direction in enumerate(directions)))
        case s.Spherical():
            return Frame(_moved().position, _attitude(c.value, c.rate, c.acceleration))
        case s.Free():
            return _floating(c)
    return _rotated()


def _rotated(*turns: tuple[ArrayLike, Jet]) -> Frame:
    """Successive rotations about carried axes."""
    rotation = constant(np.eye(3)[None, None])
    for axis, angle in turns:
        rotation = rotation @ rotation_about(axis, angle)
    return Frame(constant(np.zeros((1, 1, 3))), rotation)


def _moved(*steps: tuple[ArrayLike, Jet]) -> Frame:
    """A sum of translations along fixed axes."""
    position = constant(np.zeros((1, 1, 3)))
    for axis, distance in steps:
        position = position + product(np.multiply, constant(axis), distance[..., None])
    return Frame(position, constant(np.eye(3)[None, None]))


def _floating(c: Jet) -> Frame:
    """q = [p; quaternion], u = [w; v] in turning axes: p' = R v, p'' = R (w x v + dv/dt)."""
    w, v = c.rate[..., :3], c.rate[..., 3:]
    rotation = _attitude(c.value[..., 3:], w, c.acceleration[..., :3])
    back = np.swapaxes(rotation.value, -1, -2)
    position = Jet(c.value[..., :3], v @ back[0], (np.cross(w, v) + c.acceleration[..., 3:]) @ back[0])
    return Frame(position, rotation)


def _attitude(quaternion: Real, w: Real, w_rate: Real) -> Jet:
    """R of a scalar-first quaternion with angular velocity w in turning axes: R' = R w~, R'' = R (w~ w~ + dw/dt~)."""
    q0, qv = quaternion[0, 0, 0], quaternion[0, 0, 1:]
    R = (q0 * q0 - qv @ qv) * np.eye(3) + 2.0 * np.outer(qv, qv) + 2.0 * q0 * skew(qv)
    R = R[None, None] / np.sum(quaternion**2)
    return Jet(R, R @ skew(w), R @ (skew(w) @ skew(w) + skew(w_rate)))


def on_body(seat: Seat, eta: Jet) -> Frame:
    """A seat seen from its body: the node at x + phi eta, turned by exp((psi eta)~), then the fixed offset.

    At level stiffened the second-order parts are added to phi eta and psi eta.
    """
    node = seat.node
    moved = eta.map(lambda x: x @ node.translation.T)
    turned = eta.map(lambda x: x @ node.rotation_modes.T)
    if node.second is not None:
        moved = moved + quadratic(node.second.translation, eta[..., None, :])
        turned = turned + quadratic(node.second.rotation, eta[..., None, :])
    rotation = rotation_exponential(turned) @ constant(node.rotation)
    return Frame(constant(node.position) + moved, rotation).carry(Frame(constant(seat.offset), constant(seat.rotation)))


def field(member: Member, motion: Motion) -> Frame:
    """Mass centres and axes of a member's inertia points seen from its body: Jain & Rodriguez (2), turned exactly."""
    model, eta = member.model, motion.modes(member)[:, 0]
    moved = eta.map(lambda x: np.einsum("pam,bm->bpa", model.translation, x))
    turned = eta.map(lambda x: np.einsum("pam,bm->bpa", model.rotation, x))
    if model.second is not None:
        moved = moved + quadratic(model.second.translation, eta[:, None, None])
        turned = turned + quadratic(model.second.rotation, eta[:, None, None])
    rotation = rotation_exponential(turned)
    return Frame(constant(model.position) + moved + turn(rotation, constant(model.com_offset)), rotation)
