"""A scene for the dense route: members from base to tip, their inertia points, and the indices of their coordinates.

The order of q and u is body by body (depth-first, point masses last), in each body hinge, modes, wheels.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import assert_never

import numpy as np
from numpy.typing import ArrayLike

from flexmb.dense.hinge_frames import hinge_sizes, rotation_of
from flexmb.dense.jets import MovingFrame, constant
from flexmb.kept import kept
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode
from flexmb.modal.strain_field import StrainField
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY, ZERO, Quaternion, Vector
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.tree import GROUND, coordinates, ends, ordered, rest_frames
from flexmb.typing import Real

LEVELS = ("rigid", "ruthless", "linear", "full", "stiffened", "exact")


@dataclass(frozen=True)
class Seat:
    """A frame fixed to a node: `offset` (3,) m and `rotation` (3,3) frame -> node, in node axes.

    `field`: the sections of the node's body, at level exact.
    """

    node: FlexibleNode
    offset: Real
    rotation: Real
    field: StrainField | None

    @kept
    def undeformed(self) -> MovingFrame:
        """The frame seen from its body where this has no modes."""
        node = MovingFrame(constant(self.node.position[None, None]), constant(self.node.rotation[None, None]))
        return node.carry(MovingFrame(constant(self.offset), constant(self.rotation)))


@dataclass(frozen=True)
class Member:
    """One body or point mass, and the hinge that connects it to its parent, -1 for the ground."""

    name: str
    parent: int
    hinge: s.Hinge | s.PointMass
    inboard: Seat
    outboard: Seat
    model: FlexibleModel
    level: s.Level
    q_hinge: slice
    u_hinge: slice
    q_modes: slice
    u_modes: slice


@dataclass(frozen=True)
class Rotor:
    """A wheel on a member: the frame of its centre, and its indices in q and u."""

    wheel: s.Wheel
    member: int
    seat: Seat
    q: int
    u: int

    @property
    def inertia(self) -> Real:
        """(3,3) about the centre, in axes that turn with the wheel."""
        axis = np.array(self.wheel.axis)
        along = np.outer(axis, axis)
        return self.wheel.axial_inertia_kg_m2 * along + self.wheel.transverse_inertia_kg_m2 * (np.eye(3) - along)


@dataclass(frozen=True)
class ScalarSpeed:
    """A speed that is the rate of one coordinate, with the forces on it; `q`, `u` are the indices of both."""

    owner: str
    q: int
    u: int
    stiffness: float
    damping: float
    rest: float
    armature: float
    motor: s.Function | None
    prescribed: s.Function | None


@dataclass(frozen=True)
class DenseTree:
    """A scene as the dense route uses it."""

    members: list[Member]
    rotors: list[Rotor]
    scalars: list[ScalarSpeed]
    sites: dict[str, tuple[int, Seat]]  # "load:<name>", "marker:<name>", "connector a:<name>"
    nq: int
    nu: int

    @property
    def linear(self) -> list[int]:
        """Numbers of the members of level linear."""
        return [k for k, member in enumerate(self.members) if member.level == "linear"]

    def index(self, name: str) -> int:
        """Number of a member; -1 for the ground."""
        return -1 if name == GROUND else [member.name for member in self.members].index(name)


def build(scene: s.Scene, folder: Path | None = None) -> DenseTree:
    """The tree of a scene; `.npz` files are looked up in `folder`."""
    models = {GROUND: rigid_model(0.0, np.zeros(3), np.zeros((3, 3)), {"origin": (ZERO, IDENTITY)})}
    models |= {body.name: _model(body, folder) for body in scene.bodies}
    tree = DenseTree([], [], [], {}, 0, 0)
    for body, hinge in ordered(scene):
        inboard = _seat(models[hinge.parent], hinge.parent_node, hinge.parent_position_m, hinge.parent_quaternion)
        outboard = _seat(models[body.name], hinge.child_node, hinge.child_position_m, hinge.child_quaternion)
        tree = _append(tree, body.name, hinge.parent, hinge, inboard, outboard, models[body.name], body.level)
        for wheel in scene.wheels:
            if wheel.body == body.name:
                tree = _append_wheel(tree, wheel, _seat(models[body.name], wheel.node, wheel.offset_m))
    for mass in scene.point_masses:
        point = rigid_model(mass.mass_kg, np.zeros(3), np.zeros((3, 3)), {"origin": (ZERO, IDENTITY)})
        inboard, outboard = _seat(models[mass.body], mass.node, mass.offset_m), _seat(point, "origin")
        tree = _append(tree, mass.name, mass.body, mass, inboard, outboard, point, "rigid")
    sites = {f"load:{x.name}": (tree.index(x.body), _seat(models[x.body], x.node)) for x in scene.loads}
    for x in scene.markers:
        sites[f"marker:{x.name}"] = tree.index(x.body), _seat(models[x.body], x.node, x.offset_m)
    for connector in scene.connectors:
        if isinstance(connector, BetweenNodes):
            for side, end in zip("ab", ends(connector), strict=True):
                seat = _seat(models[end.body], end.node, end.position_m, end.quaternion)
                sites[f"connector {side}:{connector.name}"] = tree.index(end.body), seat
    return replace(tree, sites=sites)


def _append(
    tree: DenseTree, name: str, parent: str, hinge: s.Hinge | s.PointMass, inboard: Seat, outboard: Seat,
    model: FlexibleModel, level: s.Level,
) -> DenseTree:  # fmt: skip
    (nq, nu), m = hinge_sizes(hinge), model.mode_count
    q, u = tree.nq, tree.nu
    member = Member(
        name, tree.index(parent), hinge, inboard, outboard, model, level,
        slice(q, q + nq), slice(u, u + nu), slice(q + nq, q + nq + m), slice(u + nu, u + nu + m),
    )  # fmt: skip
    scalars = [
        ScalarSpeed(hinge.name, q + n, u + n, *c.spring, c.armature, c.effort, c.prescribed)
        for n, (_, c) in enumerate(coordinates(hinge))
    ]
    return replace(tree, members=[*tree.members, member], scalars=tree.scalars + scalars, nq=q + nq + m, nu=u + nu + m)


def _append_wheel(tree: DenseTree, wheel: s.Wheel, seat: Seat) -> DenseTree:
    rotor = Rotor(wheel, len(tree.members) - 1, seat, tree.nq, tree.nu)
    friction, motor, prescribed = wheel.friction_Nms_rad, wheel.torque_Nm, wheel.prescribed_rad
    scalar = ScalarSpeed(wheel.name, tree.nq, tree.nu, 0.0, friction, 0.0, 0.0, motor, prescribed)
    return replace(tree, rotors=[*tree.rotors, rotor], scalars=[*tree.scalars, scalar], nq=tree.nq + 1, nu=tree.nu + 1)


def _seat(model: FlexibleModel, node: str, offset: ArrayLike = ZERO, quaternion: ArrayLike = IDENTITY) -> Seat:
    return Seat(model.nodes[node], np.array(offset, dtype=float), rotation_of(quaternion), model.field)


def _model(body: s.Body, folder: Path | None) -> FlexibleModel:
    match body:
        case s.RigidBody():
            frames = {name: (frame.position, frame.quaternion) for name, frame in rest_frames(body).items()}
            return rigid_model(body.mass_kg, np.array(body.com_m), np.array(body.inertia_kg_m2), frames)
        case s.BeamBody() | s.ModalBody() if body.level in LEVELS:
            model = flexible_model(body, folder)
            return _stiff(model) if body.level == "rigid" else model
        case s.BeamBody() | s.ModalBody() | s.SidBody():
            raise NotImplementedError(f'body "{body.name}": the dense route has levels {", ".join(LEVELS)}')
        case _:
            assert_never(body)


def rigid_model(
    mass: float, com: Real, inertia: Real, frames: Mapping[str, tuple[Vector, Quaternion]]
) -> FlexibleModel:
    """A body without modes: one inertia point at its mass centre."""
    none = np.zeros((3, 0))
    nodes = {
        name: FlexibleNode(np.array(position, dtype=float), rotation_of(quaternion), none, none)
        for name, (position, quaternion) in frames.items()
    }
    return FlexibleModel(
        mass=np.array([mass]), position=com[None], com_offset=np.zeros((1, 3)), inertia=inertia[None],
        translation=none[None], rotation=none[None], stiffness=np.zeros((0, 0)), damping=np.zeros((0, 0)),
        nodes=nodes, clamped=True,
    )  # fmt: skip


def _stiff(model: FlexibleModel) -> FlexibleModel:
    """The same body without modes."""
    nodes = {
        name: replace(node, translation=node.translation[:, :0], rotation_modes=node.rotation_modes[:, :0])
        for name, node in model.nodes.items()
    }
    return replace(
        model, nodes=nodes, translation=model.translation[..., :0], rotation=model.rotation[..., :0],
        stiffness=model.stiffness[:0, :0], damping=model.damping[:0, :0],
    )  # fmt: skip
