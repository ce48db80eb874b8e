"""A body of a scene from a SID file: few point masses and modes with the same modal integrals.

Every inertia integral of a SID file is a sum m a b of two fields a, b on the points: 1, coordinates of r, coordinates
of phi_n. The masses of `flexmb.interchange.point_masses` therefore have the dynamics of the file at every level up to
"full". Geometric stiffness, which is in the slopes of Ct, Cr and Oe of a SID file, is passed on as `gravity_stiffness`
and `gradient_stiffness`, for level "stiffened".
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import msgspec
import numpy as np

from flexmb.interchange.imported import possible_inertia
from flexmb.interchange.point_masses import (
    FARTHEST,
    EquivalentMasses,
    NearPoints,
    NoMasses,
    equivalent_masses,
    points_with,
)
from flexmb.interchange.sid.blocks import Sid, SidError, SidNode, Taylor
from flexmb.interchange.sid.files import read_sid
from flexmb.interchange.sid.sums import PRINTED, Scale, Sums, axial, largest, planar, second_moment
from flexmb.modal.first_order import symmetric
from flexmb.scene.bodies import Level, ModalBody, SidBody
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.problems import SceneError, SceneWarning
from flexmb.scene.quaternions import cross_matrix, quaternion_of
from flexmb.scene.rigid_equivalent import steiner
from flexmb.scene.rounding import ROUNDING
from flexmb.scene.schema import Scene
from flexmb.typing import Real

SOFT = 1e-12
"""Share of the largest stiffness by which modes that have less, or none, are weighed."""
AT_REST: tuple[Level, ...] = ("rigid", "ruthless")
"""Levels that need no change of inertia with the modes."""


@dataclass(frozen=True)
class ImportedSid:
    """The body, and notes on what it omits or assumes of the file; `disagreements` are those on blocks of the file that
    contradict each other, with figures and which one was taken."""

    body: ModalBody
    notes: tuple[str, ...]
    disagreements: tuple[str, ...] = ()


def imported_sid(sid: Sid, name: str, level: Level | None = None, repair: bool = False) -> ImportedSid:
    """A raw modal body with the modal integrals of `sid`.

    Its default level is "full", or "ruthless" for a file that does not describe changes of inertia with the modes, or
    describes such as no distribution of mass has. It is "clamped-free" if a node at the origin is moved by no mode, or
    if no node is at the origin and the modes have momentum, as a frame that is fixed to the material sees it. Raises
    SidError, which names the file and the block, for mass, mdCM, J or Me that no distribution of mass can have, for
    such changes of inertia if the level needs them, and for what scenes do not support. With `repair` an impossible J
    is changed by the least amount.
    """
    try:
        return _imported(sid, name, level, repair)
    except SidError as error:
        raise SidError(f"{sid.file}: {error}" if sid.file else str(error)) from None
    except SceneError as error:
        raise SceneError(sid.file or name, error.problems) from None


def _imported(sid: Sid, name: str, level: Level | None, repair: bool) -> ImportedSid:
    """`imported_sid`, whose errors name no file yet."""
    _refuse(sid)
    notes, disagreements = list[str](), list[str]()
    sid = planar(sid, notes)
    if repair:
        sid = _repaired(sid, disagreements)
    try:
        equivalent_masses(_gram(sid, None))
    except NoMasses:
        raise SidError(
            "no distribution of mass has mass, mdCM and J: about the mass centre, a principal moment is below zero or "
            "above the sum of the others; correct their signs and units, or convert the file by flexmb import --repair"
        ) from None
    sums = Sums(sid, notes, disagreements)
    points = _points(sid, sums, level, disagreements)
    if sid.Me.slope is not None and largest(sid.Me.slope) > PRINTED * largest(sid.Me.zero):
        notes.append(
            "Me has a slope, from inertia that turns with its points: of that only geometric stiffness is carried"
        )
    scale = Scale.of(sid)
    nodes = [node for node in sid.nodes if not _is_body_frame(node, scale)]
    geometric = {} if sums.at_rest_only else _geometric_stiffness(sid, sums)
    body = {
        "name": name,
        "points": inertia_points(*points),
        "stiffness": sid.Ke.zero + (0.0 if sid.ksigma.slope is None else sid.ksigma.slope[:, :, 0]),
        "damping": sid.De.zero if np.any(sid.De.zero) else (),
        "boundary": "clamped-free" if _is_clamped(sid, scale) else "free-free",
        "level": level or ("ruthless" if sums.at_rest_only else "full"),
        "nodes": [_node(node, bool(geometric)) for node in nodes],
        **geometric,
    }
    if sums.at_rest_only and body["level"] not in AT_REST:
        raise SidError(
            f'SID body "{name}": Gr and Oe have no M1, the change of inertia with the modes, which level '
            f'"{body["level"]}" needs: use level "ruthless", or write the file with order 1'
        )
    return ImportedSid(to_struct(plain(body), ModalBody), (*notes, *disagreements), tuple(disagreements))


def with_sid_bodies(scene: Scene) -> Scene:
    """The scene with its SID bodies read from their files, as raw modal bodies; warns of blocks that contradict each
    other. Raises SidError or OSError."""
    if not any(isinstance(body, SidBody) for body in scene.bodies):
        return scene
    bodies = (_from_its_file(body) if isinstance(body, SidBody) else body for body in scene.bodies)
    return msgspec.structs.replace(scene, bodies=tuple(bodies))


def _from_its_file(body: SidBody) -> ModalBody:
    bodies = imported_sid(read_sid(body.file), body.name, body.level)
    for disagreement in bodies.disagreements:
        warnings.warn(f"{body.file}: {disagreement}", SceneWarning, stacklevel=3)
    return msgspec.structs.replace(bodies.body, stiffness_factor=body.stiffness_factor)


def _repaired(sid: Sid, disagreements: list[str]) -> Sid:
    """The file with the J nearest to its own that a body of this mass and mass centre can have."""
    centre = sid.mdCM.zero[:, 0] / sid.mass
    carried = steiner(sid.mass, centre)
    J = possible_inertia(sid.mass, 0.5 * (sid.J.zero + sid.J.zero.T) - carried) + carried
    changed = largest(J - sid.J.zero)
    if changed <= PRINTED * largest(sid.J.zero):
        return sid
    disagreements.append(f"no distribution of mass has mdCM and J: J was changed by {changed:.3g} of {largest(J):.3g}")
    return replace(sid, J=Taylor(J, sid.J.first))


def _points(sid: Sid, sums: Sums, level: Level | None, disagreements: list[str]) -> EquivalentMasses:
    """Point masses with the integrals of the file. If no masses have all, those at rest are kept, and others that
    `level` needs are near to those of the file."""
    whole = _gram(sid, sums)
    try:
        return equivalent_masses(whole)
    except NoMasses as error:
        of = f"no distribution of mass has Me, Gr and Oe of mode {max(error.field - 4, 0) // 3 + 1}"
    at_rest_only = level in (None, *AT_REST)
    if at_rest_only:
        disagreements.append(f'{of}: only what they are at rest is taken, for level "ruthless"')
    with_change = sums.change
    sums.leave_at_rest()
    try:
        at_rest = equivalent_masses(_gram(sid, sums))
    except NoMasses:
        raise SidError(f"{of}, Ct and Cr even at rest: correct their signs") from None
    if at_rest_only:
        return at_rest
    found, distance = _near(sid, sums, whole)
    mixed = np.any(with_change) and sid.Gr.first is None  # with geometric stiffness, which level "stiffened" needs
    if mixed and level == "stiffened" or not distance <= FARTHEST:
        remedy = "write the file with M1 of Gr" if mixed else "correct their signs"
        raise SidError(
            f"{of}; the nearest ones have frequencies that are off by {distance:.2g}, and the limit is {FARTHEST:g}: "
            f'{remedy}, or use level "ruthless", which needs what they are at rest only'
        )
    disagreements.append(
        f"{of}: at rest they are kept, and the change of inertia with the modes is that of near masses, which have "
        f"frequencies that are off by {distance:.2g}"
    )
    sums.change, sums.at_rest_only = with_change, False
    return found


def _near(sid: Sid, sums: Sums, whole: Real) -> NearPoints:
    """Points with the mass matrix of `sums` at rest, near to those with the sums `whole`, which none have.

    Raises SidError if none have that mass matrix.
    """
    from scipy.linalg import eigh

    centre = cross_matrix(sid.mdCM.zero[:, 0])
    couplings = np.hstack([sums.Ct, axial(sums.P)])
    rigid = np.block([[sid.mass * np.eye(3), -centre], [centre, sid.J.zero]])
    S = np.block([[rigid, couplings.T], [couplings, sid.Me.zero]])
    stiffness, V = eigh(symmetric(sid.Ke.zero), symmetric(sid.Me.zero))  # modes of unit mass
    modes, fields = np.eye(len(S)), np.eye(len(whole))
    modes[6:, 6:], fields[4:, 4:] = V, np.kron(V, np.eye(3))
    omega = np.sqrt(np.maximum(stiffness, SOFT * largest(stiffness) or 1.0))
    upper = np.triu(whole) + np.triu(whole, 1).T
    try:
        (mass, position, shapes), distance = points_with(modes.T @ S @ modes, fields.T @ upper @ fields, omega)
    except NoMasses as error:
        raise SidError(f"Me, Ct and Cr are not those of masses ({error}): correct their signs") from None
    return NearPoints(EquivalentMasses(mass, position, shapes @ np.linalg.inv(V)), distance)


def _gram(sid: Sid, sums: Sums | None) -> Real:
    """The Gram matrix of the fields 1, r and phi_n, (4+3m, 4+3m); of 1 and r, (4, 4), without `sums`."""
    m = 0 if sums is None else sums.m
    gram = np.zeros((4 + 3 * m, 4 + 3 * m))
    gram[0, 0] = sid.mass
    gram[0, 1:4] = sid.mdCM.zero[:, 0]
    gram[1:4, 1:4] = second_moment(sid.J.zero)
    if sums is not None:
        gram[0, 4:] = sums.Ct.ravel()
        gram[1:4, 4:] = sums.P.reshape(3 * m, 3).T
        gram[4:, 4:] = sums.Q.transpose(0, 2, 1, 3).reshape(3 * m, 3 * m)
    return gram


def _geometric_stiffness(sid: Sid, sums: Sums) -> dict[str, Real]:
    """Geometric stiffness under unit accelerations (3,m,m) and gradients (3,3,m,m); empty if the file has none."""
    Ct1 = np.zeros((sums.m, sums.m, 3)) if sid.Ct.first is None else sid.Ct.first
    Cr1 = np.zeros((sums.m, sums.m, 3)) if sid.Cr.first is None else sid.Cr.first
    along, turning = (0.5 * (part + np.swapaxes(part, 0, 1)) for part in (Ct1, Cr1))
    moment = sums.change + 0.5 * cross_matrix(turning)
    if max(largest(along) * Scale.of(sid).reach, largest(moment)) <= PRINTED * largest(sums.Q):
        return {}
    return {
        "gravity_stiffness": -np.moveaxis(along, -1, 0),
        "gradient_stiffness": -np.moveaxis(moment, (-2, -1), (0, 1)),
    }


def _node(node: SidNode, with_second: bool) -> dict[str, object]:
    return {
        "name": node.name,
        "position_m": node.origin.zero[:, 0],
        "quaternion": quaternion_of(node.AP.zero),
        "translation_modes": node.phi.zero.T,
        "rotation_modes": node.psi.zero.T,
        "second_translation": _field(node.phi) if with_second else (),
        "second_rotation": _field(node.psi) if with_second else (),
    }


def _field(shape: Taylor) -> Real:
    """Second-order field (m,m,3) of a node's shape functions, zero if it has none."""
    m = shape.zero.shape[1]
    return np.zeros((m, m, 3)) if shape.first is None else shape.first.transpose(1, 2, 0)


def _held(node: SidNode, scale: Scale) -> bool:
    """Whether the node is at the origin and no mode moves it."""
    moved = max(largest(node.phi.zero), scale.reach * largest(node.psi.zero))
    return largest(node.origin.zero) <= ROUNDING * scale.reach and moved <= ROUNDING * scale.shape


def _is_clamped(sid: Sid, scale: Scale) -> bool:
    """Whether the body frame is fixed to the material: a node there is held, or there is none and modes have momentum.

    In a mean frame, which no material need be fixed to, modes have no momentum.
    """
    if any(_held(node, scale) for node in sid.nodes):
        return True
    somewhere = min((largest(node.origin.zero) for node in sid.nodes), default=np.inf)
    momentum = max(largest(sid.Ct.zero) * scale.reach, largest(sid.Cr.zero))
    return somewhere > ROUNDING * scale.reach and momentum > PRINTED * sid.mass * scale.reach * scale.shape


def _is_body_frame(node: SidNode, scale: Scale) -> bool:
    return node.name == "origin" and _held(node, scale) and largest(node.AP.zero - np.eye(3)) <= ROUNDING


def _refuse(sid: Sid) -> None:
    """SidError for data that scenes do not support."""
    if largest(sid.ksigma.zero) > ROUNDING * largest(sid.Ke.zero):
        raise SidError("ksigma has an M0: flexmb has no bodies that are stressed at rest; measure modes from rest")
    for name in ("Ke", "De"):
        block = getattr(sid, name)
        if block.slope is not None and largest(block.slope) > ROUNDING * largest(block.zero):
            raise SidError(f"{name} has an M1: flexmb has no stiffness or damping that changes with the modes")
    for node in sid.nodes:
        if np.max(np.abs(node.AP.zero @ node.AP.zero.T - np.eye(3))) > PRINTED or np.linalg.det(node.AP.zero) < 0.0:
            raise SidError(f"AP of node {node.name} is not a rotation: correct its M0")
