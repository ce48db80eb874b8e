"""The elements of the spatial operators, body by body: Jain & Rodriguez, section II, from the definitions.

All components are in World axes, so that phi(x, y) has its printed form, without rotation matrices. Functions of the
configuration are evaluated once, at q + i h dq/dt (complex-step differentiation): the real part is the value, the
imaginary part divided by h the inertial rate, both to round-off. `value` and `rate` extract them.

Positions, directions and mode shapes come from `flexmb.dense`; nothing is taken from the compiled recursions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexmb.dense import hinge_frames
from flexmb.dense.body_frames import Motions, field, member_frames, on_body, seat_frame
from flexmb.dense.hinge_frames import hinge_frame
from flexmb.dense.jets import skew
from flexmb.dense.members import DenseTree, Member, Rotor, Seat, rigid_model
from flexmb.scene import schema as s
from flexmb.typing import Real

Complex = NDArray[np.complex128]
STEP = 2.0**-200  # h: h^2 is lost beside the value, so that rates have no truncation error


def value(x: Complex) -> Real:
    """The value at q of something evaluated at q + i h dq/dt."""
    return np.asarray(x.real)


def rate(x: Complex) -> Real:
    """The inertial rate of something evaluated at q + i h dq/dt."""
    return np.asarray(x.imag / STEP)


def phi(l: NDArray) -> NDArray:
    """phi(x, y) (6,6) of (6); l leads from x to y. phi F_y is a load about x, phi' V_x the velocity of y."""
    shift = np.eye(6, dtype=l.dtype)
    shift[:3, 3:] = skew(l)
    return shift


@dataclass(frozen=True)
class NodalBody:
    """The inertia points of one body, World axes, complex: see `value` and `rate`.

    A (P,6,m+6)   [Pi_j, phi'(k, j)]: velocity of each node for the modal speeds and the velocity of the body frame (21)
    M_s (P,6,6)   spatial inertia of each node about its own reference frame
    p (P,3)       from the node to its mass centre
    """

    A: Complex
    M_s: Complex
    p: Complex

    @property
    def M_m(self) -> Real:
        """Modal mass matrix (m+6,m+6) (23)."""
        A = value(self.A)
        return np.asarray(np.einsum("pai,pab,pbj->ij", A, value(self.M_s), A))

    def b_m(self, V_m: Real) -> Real:
        """Modal gyroscopic forces (m+6,) at V_m, (28), (31), (37); inertias turn with their nodes, which (31) omits."""
        A, M_s = value(self.A), value(self.M_s)
        w = (A @ V_m)[:, :3]
        force = M_s[:, 5, 5, None] * np.cross(w, np.cross(w, value(self.p)))
        b = np.concatenate([np.cross(w, np.einsum("pab,pb->pa", M_s[:, :3, :3], w)), force], axis=1)
        a = rate(self.A) @ V_m
        return np.asarray(np.einsum("pai,pa->i", A, b + np.einsum("pab,pb->pa", M_s, a)))


class Configuration:
    """A tree of members at coordinates q and speeds u, with every frame and mode shape in World axes."""

    def __init__(self, tree: DenseTree, q: Real, u: Real) -> None:
        self.tree, self.q, self.u = tree, q, u
        at_rest = np.zeros((1, tree.nu))
        self._motion = Motions(q + 1j * STEP * coordinate_rates(tree, q, u), at_rest, at_rest)
        self._frames = member_frames(tree, self._motion)

    def frame(self, k: int) -> tuple[Complex, Complex]:
        """F_k: origin (3,) and rotation (3,3); the ground for -1."""
        if k < 0:
            return np.zeros(3, complex), np.eye(3, dtype=complex)
        return self._frames[k].position.value[0, 0], self._frames[k].rotation.value[0, 0]

    def seat(self, k: int, seat: Seat) -> tuple[Complex, Complex]:
        """Origin (3,) and rotation (3,3) of a frame fixed to a node of member k."""
        frame = seat_frame(self.tree, self._frames, k, seat, self._motion)
        return frame.position.value[0, 0], frame.rotation.value[0, 0]

    def hinge_point(self, k: int) -> Complex:
        """O_k (3,)."""
        return self.seat(k, self.tree.members[k].outboard)[0]

    def node(self, k: int, seat: Seat) -> tuple[Complex, Complex]:
        """Position (3,) of a seat's node on member k, and Pi (6,m) of the node: J_l(theta) psi over phi."""
        at_node = replace(seat, offset=np.zeros(3), rotation=np.eye(3))
        if k < 0 or self.tree.members[k].model.mode_count == 0:
            return self.seat(k, at_node)[0], np.zeros((6, 0), complex)
        origin, R = self.frame(k)
        frame = on_body(at_node, self._unit_modes(k).modes(self.tree.members[k]))
        Pi = np.vstack([R @ frame.angular_velocity()[:, 0].T, R @ frame.position.rate[:, 0].T])
        return origin + R @ frame.position.value[0, 0], Pi

    def transmission(self, k: int, seat: Seat) -> tuple[Complex, Complex]:
        """Position t (3,) of a seat's node on member k, and A (m+6,6) = [Pi'; phi(k, t)] (15)."""
        t, Pi = self.node(k, seat)
        return t, np.vstack([Pi.T, phi(t - self.frame(k)[0])])

    def interbody(self, k: int) -> Complex:
        """Phi(p, k) (m_p+6,m_k+6) from member k to its parent p: A(p) B(p, k) (12), (14), (15)."""
        member = self.tree.members[k]
        t, A = self.transmission(member.parent, member.inboard)
        B = np.hstack([np.zeros((6, member.model.mode_count)), phi(self.frame(k)[0] - t)])
        return A @ B

    def H(self, k: int) -> Complex:
        """Joint map (n,6): velocity of O_k relative to O_k+ for each hinge speed (8)."""
        member = self.tree.members[k]
        n = member.u_hinge.stop - member.u_hinge.start
        H = hinge_frame(member.hinge, self._unit(member.u_hinge).hinge(member))
        R = self.seat(member.parent, member.inboard)[1]
        angular = np.broadcast_to(H.angular_velocity()[:, 0], (n, 3))
        linear = np.broadcast_to(H.position.rate[:, 0], (n, 3))
        return np.hstack([angular @ R.T, linear @ R.T])

    def joint_map(self, k: int) -> Complex:
        """script-H (m+n,m+6), rows [etadot; beta], with the minus sign of (17) but only one phi(O_k, k), as in (13).

        Pi_F = phi'(d, k) Pi_d; the printed phi'(O_k, k) is right only for hinge points that coincide with their nodes.
        """
        H_F = self.H(k) @ phi(self.frame(k)[0] - self.hinge_point(k))
        d, Pi_d = self.node(k, self.tree.members[k].outboard)
        Pi_F = phi(self.frame(k)[0] - d).T @ Pi_d
        m = Pi_F.shape[1]
        return np.block([[np.eye(m), -Pi_F.T], [np.zeros((len(H_F), m)), H_F]])

    def nodal_body(self, k: int) -> NodalBody:
        """Inertia points of member k at their nodes, World axes (21), (22)."""
        member = self.tree.members[k]
        model, m = member.model, member.model.mode_count
        R = self.frame(k)[1]
        at_nodes = replace(member, model=replace(model, com_offset=np.zeros_like(model.com_offset)))
        nodes = field(at_nodes, self._unit_modes(k))
        A = np.zeros((len(model.mass), 6, m + 6), complex)
        A[:, :3, :m] = np.einsum("ab,npb->pan", R, nodes.angular_velocity())
        A[:, 3:, :m] = np.einsum("ab,npb->pan", R, np.broadcast_to(nodes.position.rate, (m, len(A), 3)))
        A[:, :, m:] = np.array([phi(l).T for l in nodes.position.value[0] @ R.T])
        turned = R @ nodes.rotation.value[0]
        p = np.einsum("pab,pb->pa", turned, model.com_offset)
        return NodalBody(A, spatial_inertia(model.mass, turned @ model.inertia @ np.swapaxes(turned, -1, -2), p), p)

    def _unit_modes(self, k: int) -> Motions:
        return self._unit(self.tree.members[k].u_modes)

    def _unit(self, speeds: slice) -> Motions:
        """Motions (one row each) in which one of `speeds` is 1 and all others are 0."""
        units = np.eye(self.tree.nu)[speeds]
        return Motions(self._motion.q, units, np.zeros_like(units))


def spatial_inertia(mass: Real, central: NDArray, p: NDArray) -> NDArray:
    """M_s (P,6,6) about nodes: masses (P,), inertias (P,3,3) about mass centres, which lie p (P,3) from the nodes."""
    cross, m = skew(p), mass[:, None, None]
    linear = np.broadcast_to(m * np.eye(3), cross.shape)
    return np.block([[central - m * cross @ cross, m * cross], [-m * cross, linear]])


def with_wheels(tree: DenseTree) -> DenseTree:
    """The same tree with its wheels as rigid bodies on revolute hinges, numbered after all other members."""
    return replace(tree, members=[*tree.members, *(_wheel(tree, rotor) for rotor in tree.rotors)], rotors=[])


def _wheel(tree: DenseTree, rotor: Rotor) -> Member:
    """A wheel as a member. At level linear its mass is part of the body that carries it, and it has inertia only."""
    wheel = rotor.wheel
    mass = 0.0 if rotor.member in tree.linear else wheel.mass_kg
    model = rigid_model(mass, np.zeros(3), rotor.inertia, {"origin": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))})
    hinge = s.Revolute(name=wheel.name, parent=wheel.body, child=wheel.name, axis=wheel.axis)
    q, u, none = slice(rotor.q, rotor.q + 1), slice(rotor.u, rotor.u + 1), slice(0, 0)
    own = Seat(model.nodes["origin"], np.zeros(3), np.eye(3), model.field)
    return Member(wheel.name, rotor.member, hinge, rotor.seat, own, model, "rigid", q, u, none, none)


def undeformed(tree: DenseTree, q: Real, u: Real) -> tuple[Real, Real]:
    """q and u with eta = etadot = 0 for members of level ruthless, Appendix B (B1)."""
    q, u = q.copy(), u.copy()
    for member in tree.members:
        if member.level == "ruthless":
            q[member.q_modes], u[member.u_modes] = 0.0, 0.0
    return q, u


def coordinate_rates(tree: DenseTree, q: Real, u: Real) -> Real:
    """dq/dt (nq,)."""
    rates = np.zeros(tree.nq)
    for member in tree.members:
        rates[member.q_modes] = u[member.u_modes]
        rates[member.q_hinge] = hinge_frames.coordinate_rates(member.hinge, q[member.q_hinge], u[member.u_hinge])
    return rates
