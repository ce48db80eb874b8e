"""Frames of all bodies, inertia points and sites along a motion, as jets (`flexmb.dense.jets`) in World axes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexmb.dense.hinge_frames import hinge_frame, rotated
from flexmb.dense.jets import Jet, MovingFrame, constant, join, product, quadratic, rotation_exponential, turn
from flexmb.dense.members import DenseTree, Member, Rotor, Seat
from flexmb.modal.strain_field import LINEAR, SQUARE, STRETCH, WHOLE, StrainField
from flexmb.typing import Real


def section_frames(field: StrainField, eta: Jet) -> MovingFrame:
    """All sections of a beam with strains eta (B,m): position (B,n,3), rotation (B,n,3,3) from the section at rest."""

    def sums(row: int) -> Jet:
        return eta.map(lambda x: np.einsum("jam,bm->bja", field.rows[:, row], x))

    whole, linear, square, stretch = (sums(row) for row in (WHOLE, LINEAR, SQUARE, STRETCH))
    step = rotation_exponential(_magnus(whole, linear, square))
    rotations = list[Jet]()
    for j, before in enumerate(field.before):
        rotations.append(step[:, j] if before < 0 else rotations[before] @ step[:, j])
    value, rate, acceleration = (np.stack([getattr(R, part) for R in rotations], axis=1) for part in _PARTS)
    rotation = Jet(value, rate, acceleration)
    tangent = turn(rotation[:, field.gauss], constant(field.tangent[field.gauss]) + stretch[:, field.gauss])
    change = tangent + constant(-field.tangent[field.gauss])
    moved = change.map(lambda x: np.einsum("jg,bga->bja", field.weight, x))
    return MovingFrame(constant(field.position) + moved, rotation)


def _magnus(whole: Jet, linear: Jet, square: Jet) -> Jet:
    """The rotation vectors (B,n,3) of the intervals: the sixth-order expansion of Blanes, Casas and Ros (2000).

    Theirs is of Y' = A Y, here with Y = R' and A = -k~; alpha are its three sums.
    """
    alpha1, alpha2, alpha3 = -(whole + square.map(lambda x: -x / 12.0)), -linear, -square
    C1 = product(np.cross, alpha1, alpha2)
    C2 = product(np.cross, alpha1, alpha3.map(lambda x: 2.0 * x) + C1).map(lambda x: -x / 60.0)
    outer = alpha1.map(lambda x: -20.0 * x) + -alpha3 + C1
    omega = alpha1 + alpha3.map(lambda x: x / 12.0) + product(np.cross, outer, alpha2 + C2).map(lambda x: x / 240.0)
    return -omega


_PARTS = ("value", "rate", "acceleration")


class Motions(NamedTuple):
    """B motions from one configuration: coordinates q (nq,), speeds u (B,nu), rates of the speeds (B,nu)."""

    q: Real
    u: Real
    rates: Real

    def hinge(self, member: Member) -> Jet:
        """Coordinates (B,1,n) of a hinge whose speeds are the rates of its coordinates."""
        return self._part(member.q_hinge, member.u_hinge)

    def modes(self, member: Member) -> Jet:
        """eta, (B,1,m)."""
        return self._part(member.q_modes, member.u_modes)

    def spin(self, rotor: Rotor) -> Jet:
        """Angle (B,1) of a wheel."""
        return self._part(slice(rotor.q, rotor.q + 1), slice(rotor.u, rotor.u + 1))[..., 0]

    def _part(self, q: slice, u: slice) -> Jet:
        return Jet(self.q[None, None, q], self.u[:, None, u], self.rates[:, None, u])


class InertiaPoints(NamedTuple):
    """All P inertia points: mass (P,), inertia (P,3,3) about the mass centre in point axes, their member (P,)."""

    mass: Real
    inertia: Real
    member: NDArray[np.int64]


def points(tree: DenseTree) -> InertiaPoints:
    """The inertia points of all members, then those of the wheels."""
    models, rotors = [member.model for member in tree.members], tree.rotors
    counts = [len(model.mass) for model in models]
    return InertiaPoints(
        np.concatenate([*(model.mass for model in models), np.array([r.wheel.mass_kg for r in rotors])]),
        np.concatenate([*(model.inertia for model in models), *(r.inertia[None] for r in rotors)]),
        np.concatenate([np.repeat(np.arange(len(models)), counts), np.array([r.member for r in rotors], dtype=int)]),
    )


def member_frames(tree: DenseTree, motion: Motions) -> list[MovingFrame]:
    """Body frames in World, base to tip: World -> inboard seat -> hinge -> inverse of the outboard seat."""
    frames: list[MovingFrame] = []
    for member in tree.members:
        inboard = seat_frame(tree, frames, member.parent, member.inboard, motion)
        outboard = inboard.carry(hinge_frame(member.hinge, motion.hinge(member)))
        frames.append(outboard.carry(on_body(member.outboard, motion.modes(member)).inverse()))
    return frames


def seat_frame(tree: DenseTree, frames: list[MovingFrame], k: int, seat: Seat, motion: Motions) -> MovingFrame:
    """A seat on member k (-1: ground) in World."""
    if k < 0:
        return on_body(seat, constant(np.zeros((1, 1, 0))))
    return frames[k].carry(on_body(seat, motion.modes(tree.members[k])))


def point_frames(tree: DenseTree, frames: list[MovingFrame], motion: Motions) -> MovingFrame:
    """Mass centres and axes of all inertia points in World, in the order of `points`."""
    found = [frame.carry(field(member, motion)) for frame, member in zip(frames, tree.members, strict=True)]
    for rotor in tree.rotors:
        spin = rotated((rotor.wheel.axis, motion.spin(rotor)))
        found.append(seat_frame(tree, frames, rotor.member, rotor.seat, motion).carry(spin))
    count = len(motion.u)
    return MovingFrame(join([f.position for f in found], count), join([f.rotation for f in found], count))


def on_body(seat: Seat, eta: Jet) -> MovingFrame:
    """A seat seen from its body: the node at x + phi eta, turned by exp((psi eta)~), then the fixed offset.

    At level stiffened the second-order parts are added to phi eta and psi eta; at level exact the node moves with its
    section.
    """
    node = seat.node
    fixed = MovingFrame(constant(seat.offset), constant(seat.rotation))
    if seat.field is not None and node.section >= 0:
        section = section_frames(seat.field, eta[:, 0]).chosen(np.array([node.section]))
        return MovingFrame(section.position, section.rotation @ constant(node.rotation[None, None])).carry(fixed)
    if not eta.value.shape[-1]:  # most bodies are rigid, and the exponential is expensive
        return seat.undeformed
    moved = eta.map(lambda x: x @ node.translation.T)
    turned = eta.map(lambda x: x @ node.rotation_modes.T)
    if node.second is not None:
        moved = moved + quadratic(node.second.translation, eta[..., None, :])
        turned = turned + quadratic(node.second.rotation, eta[..., None, :])
    rotation = rotation_exponential(turned) @ constant(node.rotation[None, None])
    return MovingFrame(constant(node.position) + moved, rotation).carry(fixed)


def field(member: Member, motion: Motions) -> MovingFrame:
    """Mass centres and axes of a member's inertia points in its body frame: Jain & Rodriguez (2) at finite rotation."""
    model, eta = member.model, motion.modes(member)[:, 0]
    if model.field is not None and model.section is not None:
        sections = section_frames(model.field, eta).chosen(model.section)
        return sections.carry(MovingFrame(constant(model.com_offset), constant(np.eye(3)[None])))
    moved = eta.map(lambda x: np.einsum("pam,bm->bpa", model.translation, x))
    turned = eta.map(lambda x: np.einsum("pam,bm->bpa", model.rotation, x))
    if model.second is not None:
        moved = moved + quadratic(model.second.translation, eta[:, None, None])
        turned = turned + quadratic(model.second.rotation, eta[:, None, None])
    rotation = rotation_exponential(turned)
    return MovingFrame(constant(model.position) + moved + turn(rotation, constant(model.com_offset)), rotation)
