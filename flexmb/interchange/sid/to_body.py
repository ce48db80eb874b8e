"""A body of a scene from a SID file: few point masses and modes with the same modal integrals.

Every inertia integral of a SID file is a sum m a b of two fields a, b on the points: 1, coordinates of r, coordinates
of phi_n. The masses of `flexmb.interchange.gram` therefore have the dynamics of the file at every level up to "full".
Geometric stiffness, which is in the slopes of Ct, Cr and Oe of a SID file, is passed on as `gravity_stiffness` and
`gradient_stiffness`, for level "stiffened".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import msgspec
import numpy as np

from flexmb.interchange.gram import EquivalentMasses, NoMasses, equivalent_masses
from flexmb.interchange.sid.blocks import Sid, SidError, SidNode, Taylor
from flexmb.interchange.sid.from_body import COLUMNS, ROWS
from flexmb.interchange.sid.reader import read_sid
from flexmb.modal.cross import cross_matrix
from flexmb.modal.first_order import symmetric
from flexmb.scene.bodies import Level, ModalBody, SidBody
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.modal_data import inertia_points
from flexmb.scene.problems import SceneError
from flexmb.scene.quaternions import quaternion_of
from flexmb.scene.rounding import ROUNDING
from flexmb.scene.schema import Scene
from flexmb.typing import Real

PRINTED = 1e-6
"""Relative difference up to which redundant blocks of a file agree, for files in single precision."""


@dataclass(frozen=True)
class ImportedSid:
    """The body, and notes on what it omits or assumes of the file."""

    body: ModalBody
    notes: tuple[str, ...]


def imported_sid(sid: Sid, name: str, level: Level | None = None) -> ImportedSid:
    """A raw modal body with the modal integrals of `sid`.

    Its default level is "full", or "ruthless" for a file of order 0, which does not describe changes with the modes. A
    node at the origin that no mode moves makes it "clamped-free". Raises SidError, which names the file and the block,
    for blocks that contradict each other, that no distribution of mass can have, or that scenes do not support.
    """
    try:
        return _imported(sid, name, level)
    except SidError as error:
        raise SidError(f"{sid.file}: {error}" if sid.file else str(error)) from None
    except SceneError as error:
        raise SceneError(sid.file or name, error.problems) from None


def _imported(sid: Sid, name: str, level: Level | None) -> ImportedSid:
    """`imported_sid`, whose errors name no file yet."""
    _refuse(sid)
    notes: list[str] = []
    sums = _Sums(sid, notes)
    points = _points(sid, sums)
    scale = _Scale.of(sid)
    nodes = [node for node in sid.nodes if not _is_body_frame(node, scale)]
    geometric = {} if sums.at_rest_only else _geometric_stiffness(sid, sums)
    body = {
        "name": name,
        "points": inertia_points(*points),
        "stiffness": sid.Ke.zero + (0.0 if sid.ksigma.slope is None else sid.ksigma.slope[:, :, 0]),
        "damping": sid.De.zero if np.any(sid.De.zero) else (),
        "boundary": "clamped-free" if any(_held(node, scale) for node in sid.nodes) else "free-free",
        "level": level or ("ruthless" if sums.at_rest_only else "full"),
        "nodes": [_node(node, bool(geometric)) for node in nodes],
        **geometric,
    }
    if sums.at_rest_only and body["level"] not in ("rigid", "ruthless"):
        raise SidError(
            f'SID body "{name}": Gr and Oe have no M1, the change of inertia with the modes, which level '
            f'"{body["level"]}" needs: use level "ruthless", or write the file with order 1'
        )
    return ImportedSid(to_struct(plain(body), ModalBody), tuple(notes))


def with_sid_bodies(scene: Scene) -> Scene:
    """The scene with its SID bodies read from their files, as raw modal bodies. Raises SidError or OSError."""
    if not any(isinstance(body, SidBody) for body in scene.bodies):
        return scene
    bodies = (
        imported_sid(read_sid(body.file), body.name, body.level).body if isinstance(body, SidBody) else body
        for body in scene.bodies
    )
    return msgspec.structs.replace(scene, bodies=tuple(bodies))


class _Sums:
    """Sums of masses m and fields: P[n] = sum m phi_n r' (m,3,3), Q[n,k] = sum m phi_n phi_k' (m,m,3,3).

    `change` (m,m,3,3), symmetric: sum m r G' of the second-order field, from which geometric stiffness follows.
    """

    def __init__(self, sid: Sid, notes: list[str]) -> None:
        self.m = len(sid.modes)
        Gr0 = _matrices(sid.Gr.zero)
        self.P = -0.5 * Gr0 + 0.25 * _trace(Gr0)[..., None, None] * np.eye(3)
        size, scale = _largest(Gr0), _Scale.of(sid)
        turning, moving = (ROUNDING * sid.mass * scale.shape * each for each in (scale.reach, 1.0))
        _agree("Gr", "Cr", -2.0 * _axial(self.P), -2.0 * sid.Cr.zero, PRINTED * size + turning)
        if sid.mdCM.first is not None:
            slack = PRINTED * _largest(sid.Ct.zero) + moving
            _agree("mdCM", "Ct", sid.mdCM.first[:, :, 0].T, sid.Ct.zero, slack)
        spin = self.P - _trace(self.P)[..., None, None] * np.eye(3)
        self.order = _order_of_products(sid.Oe.zero, spin, turning)
        if sid.J.first is not None:
            _agree("J", "Gr", np.moveaxis(sid.J.first, 1, 0), -2.0 * symmetric(spin), PRINTED * size + turning)
        spin_slope = None if sid.Oe.first is None else _of_six(sid.Oe.first, self.order)
        second = None if spin_slope is None else spin_slope - 0.5 * _trace(spin_slope)[..., None, None] * np.eye(3)
        self.change = np.zeros((self.m, self.m, 3, 3))
        self.at_rest_only = sid.Gr.first is None and second is None and self.m > 0
        if sid.Gr.first is not None:
            Gr1 = np.stack([_matrices(sid.Gr.first[:, k]) for k in range(self.m)], axis=1)
            self.Q = -0.5 * Gr1 + 0.25 * _trace(Gr1)[..., None, None] * np.eye(3)
            _agree("Gr", "Me", _trace(self.Q), sid.Me.zero, PRINTED * _largest(sid.Me.zero))
            if second is not None:
                self.change = second - symmetric(self.Q)
        elif second is not None:
            self._separate(sid, second, notes)
        else:
            self.Q = self._at_rest(sid)
        if sid.Me.slope is not None and _largest(sid.Me.slope) > PRINTED * _largest(sid.Me.zero):
            notes.append(
                "Me has a slope, from inertia that turns with its points: of that only geometric stiffness is carried"
            )

    def _separate(self, sid: Sid, second: Real, notes: list[str]) -> None:
        """Q from Oe and Ge, if Gr has no M1.

        The trace of Oe that is not explained by the modal masses is taken for geometric stiffness along the longest
        axis of the body.
        """
        extra = _trace(second) - sid.Me.zero
        if _largest(extra) > PRINTED * _largest(sid.Me.zero):
            axis = np.linalg.eigh(_second_moment(sid.J.zero))[1][:, -1]
            self.change = extra[..., None, None] * np.outer(axis, axis)
            notes.append("Gr has no M1: the geometric stiffness in Oe is taken to act along the body's longest axis")
        half = 0.5 * cross_matrix(0.5 * sid.Ge.zero.reshape(self.m, self.m, 3))
        self.Q = second - self.change + half

    def _at_rest(self, sid: Sid) -> Real:
        """A Q with the correct modal masses, for a file of order 0, in which Q has no further effect.

        It is that of the projections of the modes on 1 and r, and the rest of the modal masses moves along x.
        """
        rows = np.concatenate([sid.Ct.zero[:, :, None], self.P], axis=2)
        moments = np.block([[np.array([[sid.mass]]), sid.mdCM.zero.T], [sid.mdCM.zero, _second_moment(sid.J.zero)]])
        Q = np.einsum("nab,bc,kdc->nkad", rows, np.linalg.pinv(moments, rcond=PRINTED, hermitian=True), rows)
        return Q + (sid.Me.zero - _trace(Q))[..., None, None] * np.outer([1.0, 0.0, 0.0], [1.0, 0.0, 0.0])


def _points(sid: Sid, sums: _Sums) -> EquivalentMasses:
    """Point masses with the integrals of the file."""
    m = sums.m
    gram = np.zeros((4 + 3 * m, 4 + 3 * m))
    gram[0, 0] = sid.mass
    gram[0, 1:4] = sid.mdCM.zero[:, 0]
    gram[1:4, 1:4] = _second_moment(sid.J.zero)
    gram[0, 4:] = sid.Ct.zero.ravel()
    gram[1:4, 4:] = sums.P.reshape(3 * m, 3).T
    gram[4:, 4:] = sums.Q.transpose(0, 2, 1, 3).reshape(3 * m, 3 * m)
    try:
        return equivalent_masses(gram)
    except NoMasses as error:
        of = "mass, mdCM and J" if error.field < 4 else f"Me, Gr and Oe of mode {(error.field - 4) // 3 + 1}"
        mixed = np.any(sums.change) and sid.Gr.first is None
        remedy = "write the file with M1 of Gr" if mixed else "correct their signs"
        raise SidError(f"no distribution of mass has {of}: {remedy}") from None


def _geometric_stiffness(sid: Sid, sums: _Sums) -> dict[str, Real]:
    """Geometric stiffness under unit accelerations (3,m,m) and gradients (3,3,m,m); empty if the file has none."""
    Ct1 = np.zeros((sums.m, sums.m, 3)) if sid.Ct.first is None else sid.Ct.first
    Cr1 = np.zeros((sums.m, sums.m, 3)) if sid.Cr.first is None else sid.Cr.first
    along, turning = (0.5 * (each + np.swapaxes(each, 0, 1)) for each in (Ct1, Cr1))
    moment = sums.change + 0.5 * cross_matrix(turning)
    if max(_largest(along) * _Scale.of(sid).reach, _largest(moment)) <= PRINTED * _largest(sums.Q):
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


class _Scale(NamedTuple):
    """Length (m) of a body and displacement of its points by unit modal coordinates, as its masses have them.

    What rounding leaves of a zero is measured by these.
    """

    reach: float
    shape: float

    @classmethod
    def of(cls, sid: Sid) -> _Scale:
        """The roots of mean squares."""
        squares = max(float(np.trace(sid.J.zero)), 0.0), float(np.max(np.diag(sid.Me.zero), initial=0.0))
        return cls(*np.sqrt(np.array(squares) / sid.mass).tolist())


def _held(node: SidNode, scale: _Scale) -> bool:
    """Whether the node is at the origin and no mode moves it."""
    moved = max(_largest(node.phi.zero), scale.reach * _largest(node.psi.zero))
    return _largest(node.origin.zero) <= ROUNDING * scale.reach and moved <= ROUNDING * scale.shape


def _is_body_frame(node: SidNode, scale: _Scale) -> bool:
    return node.name == "origin" and _held(node, scale) and _largest(node.AP.zero - np.eye(3)) <= ROUNDING


def _refuse(sid: Sid) -> None:
    """SidError for data that scenes do not support."""
    if _largest(sid.ksigma.zero) > ROUNDING * _largest(sid.Ke.zero):
        raise SidError("ksigma has an M0: flexmb has no bodies that are stressed at rest; measure modes from rest")
    for name in ("Ke", "De"):
        block = getattr(sid, name)
        if block.slope is not None and _largest(block.slope) > ROUNDING * _largest(block.zero):
            raise SidError(f"{name} has an M1: flexmb has no stiffness or damping that changes with the modes")
    for node in sid.nodes:
        if np.max(np.abs(node.AP.zero @ node.AP.zero.T - np.eye(3))) > PRINTED or np.linalg.det(node.AP.zero) < 0.0:
            raise SidError(f"AP of node {node.name} is not a rotation: correct its M0")


def _agree(one: str, other: str, a: Real, b: Real, slack: float) -> None:
    if _largest(a - b) > slack:
        raise SidError(f"{one} and {other} contradict each other: they are redundant, so correct one of them")


def _order_of_products(Oe: Real, spin: Real, dust: float) -> tuple[int, ...]:
    """The order of the products of angular velocities in the last three columns of Oe.

    The standard has xy, yz, zx; some programs write xy, xz, yz. Gr, which is redundant, decides. SidError if neither
    order agrees with it, but for `dust`.
    """
    wanted = symmetric(spin)
    for order in ((0, 1, 2, 3, 4, 5), (0, 1, 2, 3, 5, 4)):
        if _largest(_of_six(Oe, order) - wanted) <= PRINTED * _largest(wanted) + dust:
            return order
    raise SidError("Oe and Gr contradict each other: they are redundant, so correct one of them")


def _of_six(six: Real, order: tuple[int, ...]) -> Real:
    """Symmetric matrices (...,3,3) A with w' A w = six . w_q."""
    found = np.zeros((*six.shape[:-1], 3, 3))
    for i, j, column in zip(ROWS, COLUMNS, order, strict=True):
        found[..., i, j] += 0.5 * six[..., column]
        found[..., j, i] += 0.5 * six[..., column]
    return found


def _matrices(side_by_side: Real) -> Real:
    """Matrices side by side (3,3m) as an array (m,3,3)."""
    return side_by_side.reshape(3, -1, 3).swapaxes(0, 1)


def _second_moment(J: Real) -> Real:
    """The second moment sum m r r' that belongs to an inertia J."""
    return 0.5 * np.trace(J) * np.eye(3) - 0.5 * (J + J.T)


def _axial(P: Real) -> Real:
    """sum m r x phi from P = sum m phi r' (...,3,3)."""
    return np.stack([P[..., 2, 1] - P[..., 1, 2], P[..., 0, 2] - P[..., 2, 0], P[..., 1, 0] - P[..., 0, 1]], axis=-1)


def _largest(a: Real) -> float:
    return float(np.max(np.abs(a), initial=0.0))


def _trace(A: Real) -> Real:
    return np.trace(A, axis1=-2, axis2=-1)
