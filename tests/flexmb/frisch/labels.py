"""Bodies and wheels of a tree as the paper's symbols, World axes, for the sums of `nested_reference`.

What each body is by itself: mode-dependent parameters at its deformation, corrected as docs/errata.md says; poses and
rates come from the jets of the dense route. Nothing of the compiled tables is seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexmb.dense import DenseSystem
from flexmb.dense.body_frames import Motions, member_frames, on_body
from flexmb.dense.function_jets import profile
from flexmb.dense.jets import Jet, MovingFrame, skew
from flexmb.dense.members import Member, Rotor, Seat
from flexmb.frisch.parameters import ModeParameters, mode_parameters
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.scene import schema as s
from tests.flexmb.frisch.contiguous import WORLD, hinge_point, seen_from

ZERO = np.zeros(3)


@dataclass(frozen=True)
class Wheel:
    """Symmetric wheel m in body MO(m): tensor I_W (26), its rate seen from the body, relative angular rate (120)."""

    carrier: int  # MO(m)
    I_W: np.ndarray
    I_W_rate: np.ndarray
    relative_rate: np.ndarray


@dataclass(frozen=True)
class Body:
    """Body lambda: J is J(lambda), -1 the ground; vectors in World axes, `_rate` is the derivative that the body sees,
    of beta the one that J(lambda) sees.

    alpha (47), Phi (49) without wheels, Delta_L (53); A, Q, H, K (n,...) at the deformation: H_n + sum F_mn a_m and
    sum a_m' K_mn; A_0, alpha_0 undeformed; F_e, phi_e external force and torque about the mass centre; on_modes what
    they do on the modes; elastic the right side of (186).
    """

    J: int
    point_mass: bool
    translates: bool
    m: float
    omega: np.ndarray
    beta: np.ndarray
    beta_rate: np.ndarray
    alpha: np.ndarray
    alpha_rate: np.ndarray
    alpha_0: np.ndarray
    Phi: np.ndarray
    Phi_rate: np.ndarray
    Delta_L: np.ndarray
    A: np.ndarray
    A_0: np.ndarray
    Q: np.ndarray
    H: np.ndarray
    K: np.ndarray
    M1: np.ndarray
    elastic: np.ndarray
    F_e: np.ndarray
    phi_e: np.ndarray
    on_modes: np.ndarray


def at(dense: DenseSystem, q: np.ndarray, u: np.ndarray, t: float) -> tuple[list[Body], list[Wheel]]:
    """All bodies and wheels at a state that is on its profiles."""
    motion = Motions(q, u[None], np.zeros((1, dense.nu)))
    frames = member_frames(dense.tree, motion)
    bodies = [_body(dense, k, frames, motion, t) for k in range(len(frames))]
    return bodies, [_wheel(dense, rotor, frames, motion) for rotor in dense.tree.rotors]


def _body(dense: DenseSystem, k: int, frames: list[MovingFrame], motion: Motions, t: float) -> Body:
    member = dense.tree.members[k]
    R, a, adot = frames[k].rotation.value[0, 0], motion.q[member.q_modes], motion.u[0, member.u_modes]
    p = turned(parameters(dense, k), R)
    point = frames[k].carry(hinge_point(member))
    inboard = WORLD
    if member.parent >= 0:
        inboard = frames[member.parent].carry(hinge_point(dense.tree.members[member.parent]))
    seen = seen_from(inboard, point, 1)
    back = point.position.value[0, 0] - frames[k].position.value[0, 0]
    shift, shift_rate = a @ p.A, adot @ p.A
    change = np.einsum("m,mna->na", a, p.A1)
    torque, force, on_modes = _external(dense, k, frames, motion, t, back + p.alpha + shift)
    weight = p.mass * np.array(dense.scene.gravity_m_s2)
    A = p.A + change
    return Body(
        J=member.parent,
        point_mass=isinstance(member.hinge, s.PointMass),
        translates=_translates(member.hinge),
        m=p.mass,
        omega=frames[k].angular_velocity()[0, 0],
        beta=seen.position,
        beta_rate=seen.rate[0],
        alpha=p.alpha + shift,
        alpha_rate=shift_rate,
        alpha_0=p.alpha,
        Phi=p.Phi + np.einsum("n,nab->ab", a, p.E) - p.mass * (shift @ shift * np.eye(3) - np.outer(shift, shift)),
        Phi_rate=np.einsum("n,nab->ab", adot, p.E) - p.mass * _both(shift, shift_rate),
        Delta_L=adot @ p.Q - p.mass * np.cross(shift, shift_rate),
        A=A,
        A_0=p.A,
        Q=p.Q + np.einsum("m,mna->na", a, p.Q1) - p.mass * np.cross(shift, change),
        H=p.H + np.einsum("m,mnab->nab", a, p.F),
        K=np.einsum("m,mna->na", adot, p.K),
        M1=p.M1 + np.einsum("k,kmn->mn", a, p.M1_slope),
        elastic=-(p.stiffness @ a + p.damping @ adot),
        F_e=weight + force,
        phi_e=torque,
        on_modes=A @ weight + on_modes,
    )


def _both(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Derivative of (a.a) 1 - a a along b."""
    return 2.0 * a @ b * np.eye(3) - np.outer(a, b) - np.outer(b, a)


def parameters(dense: DenseSystem, k: int) -> ModeParameters:
    """(48)-(72), corrected, from the hinge point, in the axes of the body's data.

    The masses of wheels are elements of the body, their tensors are not (26).
    """
    member = dense.tree.members[k]
    model = member.model
    for rotor in dense.tree.rotors:
        if rotor.member == k:
            model = _with_mass(model, rotor)
    return mode_parameters(replace(model, position=model.position - hinge_point(member).position.value[0, 0]))


def _with_mass(model: FlexibleModel, rotor: Rotor) -> FlexibleModel:
    node = rotor.seat.node
    return replace(
        model,
        mass=np.append(model.mass, rotor.wheel.mass_kg),
        position=np.vstack([model.position, node.position]),
        com_offset=np.vstack([model.com_offset, node.rotation @ rotor.seat.offset]),
        inertia=np.concatenate([model.inertia, np.zeros((1, 3, 3))]),
        translation=np.concatenate([model.translation, node.translation[None]]),
        rotation=np.concatenate([model.rotation, node.rotation_modes[None]]),
    )


def turned(p: ModeParameters, R: np.ndarray) -> ModeParameters:
    """The parameters that sums need, from body axes to World."""
    tensors = {name: R @ getattr(p, name) @ R.T for name in ("Phi", "E", "H", "F")}
    vectors = {name: getattr(p, name) @ R.T for name in ("alpha", "A", "Q", "K", "A1", "Q1")}
    return replace(p, **tensors, **vectors)


def _translates(hinge: s.Hinge | s.PointMass) -> bool:
    """Whether relative translation is an independent variable; the paper's point masses and body 1 always."""
    if isinstance(hinge, s.PointMass):
        return len(hinge.directions) > 0
    return isinstance(hinge, s.Prismatic | s.Cylindrical | s.Planar | s.Free)


def _external(
    dense: DenseSystem, k: int, frames: list[MovingFrame], motion: Motions, t: float, centre: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Loads at the nodes of body k: torque about the point `centre` from its frame, force, work per rate of modes."""
    member, R = dense.tree.members[k], frames[k].rotation.value[0, 0]
    torque, force, on_modes = ZERO, ZERO, np.zeros(len(motion.q[member.q_modes]))
    for load in dense.scene.loads:
        if load.body != member.name:
            continue
        seat = shapes(member, dense.tree.sites[f"load:{load.name}"][1], motion)
        value = profile(load.function, t).value * np.array(load.direction)
        if load.frame == "node":
            value = R @ seat.rotation @ value
        if load.type == "force":
            force = force + value
            torque = torque + np.cross(R @ seat.position - centre, value)
            on_modes = on_modes + seat.phiT @ R.T @ value
        else:
            torque = torque + value
            on_modes = on_modes + seat.phiR @ R.T @ value
    return torque, force, on_modes


@dataclass(frozen=True)
class Shapes:
    """A node frame in its deformed body, body axes: pose, and (n,3) rates of it per rate of the modes (118), (124)."""

    position: np.ndarray
    rotation: np.ndarray
    phiT: np.ndarray
    phiR: np.ndarray


def shapes(member: Member, seat: Seat, motion: Motions) -> Shapes:
    a = motion.q[member.q_modes]
    unit = np.eye(len(a))[:, None] if len(a) else np.zeros((0, 1, 0))
    frame = on_body(seat, Jet(a[None, None], unit, np.zeros_like(unit)))
    shape = (len(a), 1, 3)
    phiT = np.broadcast_to(frame.position.rate, shape)[:, 0] if len(a) else np.zeros((0, 3))
    phiR = np.broadcast_to(frame.angular_velocity(), shape)[:, 0] if len(a) else np.zeros((0, 3))
    return Shapes(frame.position.value[0, 0], frame.rotation.value[0, 0], phiT, phiR)


def _wheel(dense: DenseSystem, rotor: Rotor, frames: list[MovingFrame], motion: Motions) -> Wheel:
    member, R = dense.tree.members[rotor.member], frames[rotor.member].rotation.value[0, 0]
    seat = shapes(member, rotor.seat, motion)
    node_rate = R @ (motion.u[0, member.u_modes] @ seat.phiR)
    axes = R @ seat.rotation
    I_W, nu = axes @ rotor.inertia @ axes.T, skew(node_rate)
    spin = motion.u[0, rotor.u] * axes @ np.array(rotor.wheel.axis)
    return Wheel(rotor.member, I_W, nu @ I_W - I_W @ nu, node_rate + spin)
