"""Bodies whose modal mass matrix and bias are cut off, levels linear and stiffened, by complex steps.

The sum over a body's points is entire in eta, etadot and the second-order field G. Level linear: at (i h eta, i h
etadot) its real part is the order zero and its imaginary part h times the order one; what follows is smaller by h^2 and
vanishes in rounding. Level stiffened: of the kinetic energy's terms with G those of second order in (eta, etadot) are
the ones that are linear in G and free of the mode shapes phi. With i h G for G and zero for phi, the imaginary part is
h times these; to them comes the sum without G. Masses off their points and inertias that turn are summed exactly.

Order of rows: [modes; angular; linear], about the body origin in body axes. The elements of a body are its inertia
points and the masses of its wheels; rotary inertia of wheels is not truncated, hence none of this.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexmb.dense.jets import Frame, Jet, skew, vector
from flexmb.dense.kinematics import Motion, field
from flexmb.dense.tree import Member, Rotor, Tree
from flexmb.modal.model import FlexibleModel, SecondOrder, with_node

Array = NDArray[np.float64]
STEP = 2.0**-200


@dataclass(frozen=True)
class TruncatedBody:
    """One body at one state: M (m+6,m+6) and bias (m+6,), its frame in World, its speeds and their rates (m+6,).

    Accelerations are classical, of the origin, without gravity.
    """

    M: Array
    bias: Array
    rotation: Array
    position: Array
    speeds: Array
    rates: Array

    @property
    def kinetic(self) -> float:
        return 0.5 * float(self.speeds @ self.M @ self.speeds)

    def force(self, gravity: Array) -> Array:
        """What the elements need to move so, beyond gravity (3,) in World axes: M (rates - g) + bias, (m+6,)."""
        rates = self.rates.copy()
        rates[-3:] -= self.rotation.T @ gravity
        return self.M @ rates + self.bias

    def mass_moment(self) -> Array:
        """sum m x (3,) in World: the coupling of angular and linear velocity is s~."""
        s = vector(self.M[-6:-3, -3:])
        return np.asarray(self.M[-1, -1] * self.position + self.rotation @ s)

    def world(self, rows: Array) -> tuple[Array, Array, Array]:
        """Rigid rows of a force or momentum (m+6,) in World axes: torque (1,3) about, force (1,3), position (1,3)."""
        return (self.rotation @ rows[-6:-3])[None], (self.rotation @ rows[-3:])[None], self.position[None]


def truncated_body(tree: Tree, k: int, frame: Frame, motion: Motion) -> TruncatedBody:
    """Member k, whose body frame is `frame` (1,1,...) along one motion."""
    member = tree.members[k]
    R = frame.rotation.value[0, 0]
    w = frame.angular_velocity()[0, 0] @ R
    eta, etad = motion.q[member.q_modes], motion.u[0, member.u_modes]
    alpha, a = frame.angular_acceleration()[0, 0] @ R, frame.position.acceleration[0, 0] @ R
    cut_off = _first_order if member.level == "linear" else _stiffened
    M, bias = cut_off(_elements(member, [rotor for rotor in tree.rotors if rotor.member == k]), eta, etad, w)
    return TruncatedBody(
        M, bias, R, frame.position.value[0, 0],
        np.concatenate([etad, w, frame.position.rate[0, 0] @ R]),
        np.concatenate([motion.rates[0, member.u_modes], alpha, a]),
    )  # fmt: skip


def body_jacobian(member: Member, frame: Frame, nu: int) -> Array:
    """(m+6,nu): a member's modal speeds and the velocity of its frame, body axes, for u = e_j; `frame` along those."""
    modes = np.eye(nu)[member.u_modes]
    R = frame.rotation.value[0, 0]
    linear = np.broadcast_to(frame.position.rate, (nu, 1, 3))
    return np.vstack([modes, (frame.angular_velocity()[:, 0] @ R).T, (linear[:, 0] @ R).T])


def _elements(member: Member, rotors: list[Rotor]) -> Member:
    """The member by itself, its modes first in q and u, with the masses of its wheels among its points."""
    model = member.model
    for rotor in rotors:
        node = rotor.seat.node
        model = replace(
            model,
            mass=np.append(model.mass, rotor.wheel.mass_kg),
            position=np.vstack([model.position, node.position]),
            com_offset=np.vstack([model.com_offset, node.rotation @ rotor.seat.offset]),
            inertia=np.concatenate([model.inertia, np.zeros((1, 3, 3))]),
            translation=np.concatenate([model.translation, node.translation[None]]),
            rotation=np.concatenate([model.rotation, node.rotation_modes[None]]),
            second=with_node(model, node),
        )
    modes = slice(0, model.mode_count)
    return replace(member, model=model, q_modes=modes, u_modes=modes)


def _first_order(member: Member, eta: Array, etad: Array, w: Array) -> tuple[Array, Array]:
    """Orders zero and one of M and bias in (eta, etadot)."""
    M, bias = _sum(member, 1j * STEP * eta, 1j * STEP * etad, w)
    return M.real + M.imag / STEP, bias.real + bias.imag / STEP


def _stiffened(member: Member, eta: Array, etad: Array, w: Array) -> tuple[Array, Array]:
    """M and bias with the terms of G up to the second order in (eta, etadot) of the kinetic energy."""
    model = member.model
    assert model.second is not None
    off = np.any(model.com_offset != 0.0, axis=1)
    exact = replace(model, second=_masked(model.second, off))
    on_points = replace(
        model, mass=np.where(off, 0.0, model.mass), com_offset=np.zeros_like(model.com_offset),
        inertia=np.zeros_like(model.inertia), translation=np.zeros_like(model.translation),
        second=SecondOrder(1j * STEP * model.second.translation, model.second.rotation),  # type: ignore[arg-type]
    )  # fmt: skip
    M, bias = _sum(replace(member, model=exact), eta, etad, w)
    M_G, bias_G = _sum(replace(member, model=on_points), eta, etad, w)
    return M.real + M_G.imag / STEP, bias.real + bias_G.imag / STEP


def _masked(second: SecondOrder, kept: NDArray[np.bool_]) -> SecondOrder:
    """Displacements of second order of some points only; all turn to second order."""
    return SecondOrder(np.where(kept[:, None, None, None], second.translation, 0.0), second.rotation)


def _sum(
    member: Member, eta: NDArray, etad: NDArray, w: Array
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """M and bias as sums over the points of one body that turns with w."""
    model: FlexibleModel = member.model
    m, unit = model.mode_count, np.eye(model.mode_count + 6)
    at = _points(member, eta, unit[:, :m], unit[:, m : m + 3], unit[:, m + 3 :])
    turned = at.rotation.value[0] @ model.inertia @ np.swapaxes(at.rotation.value[0], -1, -2)
    L, W = at.position.rate, at.angular_velocity()
    M = np.einsum("p,ipa,jpa->ij", model.mass, L, L) + np.einsum("ipa,pab,jpb->ij", W, turned, W)
    moving = _points(member, eta, etad[None], w[None], np.zeros((1, 3)))
    spin, turning = moving.angular_velocity()[0], moving.angular_acceleration()[0]
    torque = np.einsum("pab,pb->pa", turned, turning) + np.cross(spin, np.einsum("pab,pb->pa", turned, spin))
    force = model.mass[:, None] * moving.position.acceleration[0]
    return M, np.einsum("ipa,pa->i", L, force) + np.einsum("ipa,pa->i", W, torque)


def _points(member: Member, eta: NDArray, etad: NDArray, w: Array, v: Array) -> Frame:
    """Points at eta along B motions: etad (B,m), w and v (B,3) of the body frame, none of which changes."""
    motion = Motion(eta.astype(complex), etad.astype(complex), np.zeros(etad.shape, complex))
    turn, none = skew(w)[:, None], np.zeros((len(w), 1, 3))
    body = Frame(Jet(none, v[:, None], none), Jet(np.broadcast_to(np.eye(3), turn.shape), turn, turn @ turn))
    return body.carry(field(member, motion))
