"""Bodies of level linear: modal mass matrix and bias to first order in (eta, etadot), by a complex step.

The sum over a body's points is an entire function of eta and etadot. At (i h eta, i h etadot) its real part is the term
of order zero and its imaginary part h times the term of order one; all other terms are smaller by a factor h^2 and are
lost in rounding.

Order of rows: [modes; angular; linear], about the body origin in body axes. The elements of a body are its inertia
points and the masses of its wheels. The rotary inertia of wheels is not truncated, and therefore summed elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexmb.dense.body_frames import Motions, field, on_body
from flexmb.dense.jets import Jet, MovingFrame, constant, join, skew, vector
from flexmb.dense.members import DenseTree, Member, Rotor
from flexmb.typing import Real

STEP = 2.0**-200  # h: its square is lost beside the terms of order zero and one, but does not underflow


@dataclass(frozen=True)
class FirstOrderBody:
    """One body at one state: M (m+6,m+6) and bias (m+6,), its frame in World, its speeds and their rates (m+6,).

    Accelerations are classical, of the origin, without gravity.
    """

    M: Real
    bias: Real
    rotation: Real
    position: Real
    speeds: Real
    rates: Real

    @property
    def kinetic(self) -> float:
        return 0.5 * float(self.speeds @ self.M @ self.speeds)

    def force(self, gravity: Real) -> Real:
        """Force (m+6,) that causes this motion in addition to gravity (3,) in World axes: M (rates - g) + bias."""
        rates = self.rates.copy()
        rates[-3:] -= self.rotation.T @ gravity
        return self.M @ rates + self.bias

    def mass_moment(self) -> Real:
        """sum m x (3,) in World; s is read from the coupling block of M, which is s~."""
        s = vector(self.M[-6:-3, -3:])
        return np.asarray(self.M[-1, -1] * self.position + self.rotation @ s)

    def world(self, rows: Real) -> tuple[Real, Real, Real]:
        """Rigid rows of a force or momentum (m+6,) in World axes: torque (1,3) about, force (1,3), position (1,3)."""
        return (self.rotation @ rows[-6:-3])[None], (self.rotation @ rows[-3:])[None], self.position[None]


def first_order_body(tree: DenseTree, k: int, frame: MovingFrame, motion: Motions) -> FirstOrderBody:
    """Member k, whose body frame is `frame` (1,1,...) along one motion."""
    member = tree.members[k]
    R = frame.rotation.value[0, 0]
    w = frame.angular_velocity()[0, 0] @ R
    eta, etad = motion.q[member.q_modes], motion.u[0, member.u_modes]
    alpha, a = frame.angular_acceleration()[0, 0] @ R, frame.position.acceleration[0, 0] @ R
    M, bias = _mass_and_bias(tree, k, eta, etad, w)
    return FirstOrderBody(
        M, bias, R, frame.position.value[0, 0],
        np.concatenate([etad, w, frame.position.rate[0, 0] @ R]),
        np.concatenate([motion.rates[0, member.u_modes], alpha, a]),
    )  # fmt: skip


def body_jacobian(member: Member, frame: MovingFrame, nu: int) -> Real:
    """(m+6,nu): modal speeds of a member and velocity of its frame, body axes, for u = e_j.

    `frame` is the member's frame along these nu motions.
    """
    modes = np.eye(nu)[member.u_modes]
    R = frame.rotation.value[0, 0]
    linear = np.broadcast_to(frame.position.rate, (nu, 1, 3))
    return np.vstack([modes, (frame.angular_velocity()[:, 0] @ R).T, (linear[:, 0] @ R).T])


def _mass_and_bias(tree: DenseTree, k: int, eta: Real, etad: Real, w: Real) -> tuple[Real, Real]:
    """M and bias of first order at a state of the body: sums over its elements, evaluated at a complex step."""
    member, rotors = tree.members[k], [rotor for rotor in tree.rotors if rotor.member == k]
    model, m = member.model, member.model.mode_count
    # A wheel's mass belongs to the body; its rotary inertia turns with the wheel's frame and is not truncated.
    mass = np.append(model.mass, [rotor.wheel.mass_kg for rotor in rotors])
    inertia = np.concatenate([model.inertia, np.zeros((len(rotors), 3, 3))])
    unit = np.eye(m + 6)
    at = _elements(tree, member, rotors, eta, unit[:, :m], unit[:, m : m + 3], unit[:, m + 3 :])
    turned = at.rotation.value[0] @ inertia @ np.swapaxes(at.rotation.value[0], -1, -2)
    L, W = at.position.rate, at.angular_velocity()
    M = np.einsum("p,ipa,jpa->ij", mass, L, L) + np.einsum("ipa,pab,jpb->ij", W, turned, W)
    # eta and etad are of first order alike, hence i h with both; M (rates - g) has the accelerations, so none here.
    moving = _elements(tree, member, rotors, eta, 1j * STEP * etad[None], w[None], np.zeros((1, 3)))
    spin, turning = moving.angular_velocity()[0], moving.angular_acceleration()[0]
    torque = np.einsum("pab,pb->pa", turned, turning) + np.cross(spin, np.einsum("pab,pb->pa", turned, spin))
    force = mass[:, None] * moving.position.acceleration[0]
    bias = np.einsum("ipa,pa->i", L, force) + np.einsum("ipa,pa->i", W, torque)
    return _first_order(M), _first_order(bias)


def _elements(
    tree: DenseTree, member: Member, rotors: list[Rotor], eta: Real, etad: ArrayLike, w: Real, v: Real
) -> MovingFrame:
    """Elements at i h eta along B motions with constant etad (B,m), and w and v (B,3) of the body frame."""
    count = len(w)
    q, u = np.zeros(tree.nq, complex), np.zeros((count, tree.nu), complex)
    q[member.q_modes], u[:, member.u_modes] = 1j * STEP * eta, etad
    motion = Motions(q, u, np.zeros_like(u))
    # A body frame with constant w and without acceleration of its origin: R = 1, R' = w~, R'' = w~ w~.
    turn, none = skew(w)[:, None], np.zeros((count, 1, 3))
    body = MovingFrame(Jet(none, v[:, None], none), Jet(np.broadcast_to(np.eye(3), turn.shape), turn, turn @ turn))
    parts = [field(member, motion)]
    for rotor in rotors:
        seat = on_body(rotor.seat, motion.modes(member))
        parts.append(MovingFrame(seat.position, constant(np.eye(3)[None, None])))
    positions, rotations = join([f.position for f in parts], count), join([f.rotation for f in parts], count)
    return body.carry(MovingFrame(positions, rotations))


def _first_order(x: NDArray[np.complex128]) -> Real:
    """The sum of the terms of orders zero and one of a function evaluated at i h times its argument."""
    return np.asarray(x.real + x.imag / STEP)
