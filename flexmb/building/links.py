"""From scene to links: every body (point masses too) with its inboard hinge, in the frame the dynamics uses.

A link's frame is the outboard frame of its hinge, turned so that a hinge axis is z; only where that hinge sits on a
node that deforms does the link keep the modal frame of its body. Wheels are folded into their body, despun (Frisch).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexmb.hinges.catalogue import kind_of
from flexmb.hinges.kind import HingeKind, z_to
from flexmb.levels.body import BY_NAME
from flexmb.levels.level import FidelityLevel
from flexmb.modal.flexible import flexible_model
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode, with_node
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY
from flexmb.scene.hinges import WITH_AXIS
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.tree import GROUND, NamedCoordinate, coordinates, ordered, rest_frames
from flexmb.typing import Real


@dataclass(frozen=True)
class Port:
    """A frame on a body: node, offset from it and rotation port -> body at rest, both in body axes."""

    node: FlexibleNode
    offset: Real
    frame: Real

    @property
    def origin(self) -> Real:
        """Its position at rest, body frame."""
        return self.node.position + self.offset

    @property
    def deforms(self) -> bool:
        """Whether modes move the node: those that are clamped there do not, Jain & Rodriguez (1)."""
        second = self.node.second
        curved = second is not None and bool(np.any(second.translation) or np.any(second.rotation))
        return curved or bool(np.any(self.node.translation) or np.any(self.node.rotation_modes))


@dataclass(frozen=True)
class BodyLink:
    """One body as the dynamics sees it, and the hinge that holds it.

    The last `wheels` points of its model are the despun wheels of the body.
    """

    name: str
    hinge: s.Hinge | s.PointMass
    parent: str
    level: FidelityLevel
    model: FlexibleModel
    wheels: int
    kind: HingeKind
    sequence: tuple[int, ...]
    inboard: Port
    outboard: Port
    scalar: tuple[NamedCoordinate, ...]


def links(scene: s.Scene) -> list[BodyLink]:
    """All links base to tip: bodies depth-first, then point masses."""
    models = {GROUND: _ground()} | {body.name: _model(body) for body in scene.bodies}
    for wheel in scene.wheels:
        models[wheel.body] = _with_wheel(models[wheel.body], wheel)
    found = []
    for body, hinge in ordered(scene):
        kind, (sequence, turn) = kind_of(hinge)
        found.append(
            BodyLink(
                name=body.name,
                hinge=hinge,
                parent=hinge.parent,
                level=_level(body),
                model=models[body.name],
                wheels=sum(wheel.body == body.name for wheel in scene.wheels),
                kind=kind,
                sequence=sequence,
                inboard=port(
                    models[hinge.parent], hinge.parent_node, hinge.parent_position_m, hinge.parent_quaternion, turn
                ),
                outboard=port(
                    models[hinge.child], hinge.child_node, hinge.child_position_m, hinge.child_quaternion, turn
                ),
                scalar=coordinates(hinge),
            )
        )
    for mass in scene.point_masses:
        found.append(_point_mass(mass, models))
    return [_in_hinge_frame(link) for link in found]


@dataclass(frozen=True)
class Side:
    """Where frame A or B of a closure is: a node of a body, fixed offsets, and the turn that brings the axis to z."""

    body: str
    node: str
    offset: s.Vector
    quaternion: s.Quaternion
    turn: Real

    def port(self, model: FlexibleModel) -> Port:
        """The frame on a body's model, as the dynamics sees it."""
        return port(model, self.node, self.offset, self.quaternion, self.turn)


def closure_sides(closure: s.Closure) -> tuple[Side, Side]:
    """Frames A and B of a closure."""
    turn = z_to(closure.axis) if closure.type in WITH_AXIS else np.eye(3)
    return (
        Side(closure.body_a, closure.node_a, closure.position_a_m, closure.quaternion_a, turn),
        Side(closure.body_b, closure.node_b, closure.position_b_m, closure.quaternion_b, turn),
    )


def port(model: FlexibleModel, node: str, offset: s.Vector, quaternion: s.Quaternion, turn: Real) -> Port:
    """The frame at `offset`, `quaternion` from a node, turned once more by `turn`."""
    at = model.nodes[node]
    return Port(at, at.rotation @ np.asarray(offset, float), at.rotation @ rotation_matrix(quaternion) @ turn)


def _ground() -> FlexibleModel:
    return _rigid_model(0.0, np.zeros(3), np.zeros((3, 3)), {"origin": (np.zeros(3), np.eye(3))})


def _rigid_model(mass: float, com: Real, inertia: Real, nodes: dict[str, tuple[Real, Real]]) -> FlexibleModel:
    """A body without modes as one inertia point at its centre of mass."""
    none = np.zeros((3, 0))
    return FlexibleModel(
        mass=np.array([mass]),
        position=com[None, :],
        com_offset=np.zeros((1, 3)),
        inertia=inertia[None, :, :],
        translation=np.zeros((1, 3, 0)),
        rotation=np.zeros((1, 3, 0)),
        stiffness=np.zeros((0, 0)),
        damping=np.zeros((0, 0)),
        nodes={name: FlexibleNode(position, rotation, none, none) for name, (position, rotation) in nodes.items()},
        clamped=True,
    )


def _level(body: s.Body) -> FidelityLevel:
    return BY_NAME["rigid" if isinstance(body, s.RigidBody) else body.level]


def _model(body: s.Body) -> FlexibleModel:
    """Inertia points and modes of any body; a flexible body at level rigid loses its modes."""
    if isinstance(body, s.RigidBody):
        frames = {name: (np.array(f.position), rotation_matrix(f.quaternion)) for name, f in rest_frames(body).items()}
        return _rigid_model(body.mass_kg, np.array(body.com_m), np.array(body.inertia_kg_m2), frames)
    if isinstance(body, s.SidBody):
        raise NotImplementedError(f'body "{body.name}": SID files are not supported yet; use kind = "modal"')
    model = flexible_model(body)
    return model if _level(body).flexible else _without_modes(model)


def _without_modes(model: FlexibleModel) -> FlexibleModel:
    return replace(
        model,
        translation=model.translation[:, :, :0],
        rotation=model.rotation[:, :, :0],
        stiffness=model.stiffness[:0, :0],
        damping=model.damping[:0, :0],
        nodes={
            name: replace(n, translation=n.translation[:, :0], rotation_modes=n.rotation_modes[:, :0])
            for name, n in model.nodes.items()
        },
    )


def _with_wheel(model: FlexibleModel, wheel: s.Wheel) -> FlexibleModel:
    """The body with the despun wheel as one more inertia point at the wheel's node."""
    node = model.nodes[wheel.node]
    axis = node.rotation @ np.asarray(wheel.axis, float)
    axial, transverse = wheel.axial_inertia_kg_m2, wheel.transverse_inertia_kg_m2
    inertia = transverse * np.eye(3) + (axial - transverse) * np.outer(axis, axis)
    return replace(
        model,
        mass=np.append(model.mass, wheel.mass_kg),
        position=np.vstack([model.position, node.position]),
        com_offset=np.vstack([model.com_offset, node.rotation @ np.asarray(wheel.offset_m, float)]),
        inertia=np.concatenate([model.inertia, inertia[None]]),
        translation=np.concatenate([model.translation, node.translation[None]]),
        rotation=np.concatenate([model.rotation, node.rotation_modes[None]]),
        second=with_node(model, node),
    )


def _point_mass(mass: s.PointMass, models: dict[str, FlexibleModel]) -> BodyLink:
    """A point mass as a body without rotary inertia on translations along its directions."""
    kind, (sequence, turn) = kind_of(mass)
    point = _rigid_model(mass.mass_kg, np.zeros(3), np.zeros((3, 3)), {"origin": (np.zeros(3), np.eye(3))})
    return BodyLink(
        name=mass.name,
        hinge=mass,
        parent=mass.body,
        level=BY_NAME["rigid"],
        model=point,
        wheels=0,
        kind=kind,
        sequence=sequence,
        inboard=port(models[mass.body], mass.node, mass.offset_m, IDENTITY, turn),
        outboard=Port(point.nodes["origin"], np.zeros(3), turn),
        scalar=coordinates(mass),
    )


def _in_hinge_frame(link: BodyLink) -> BodyLink:
    """Refer the body to its outboard hinge frame, unless that frame moves with the modes."""
    if link.outboard.deforms:
        return link
    back, origin = link.outboard.frame.T, link.outboard.origin
    m = link.model
    model = replace(
        m,
        position=(m.position - origin) @ back.T,
        com_offset=m.com_offset @ back.T,
        inertia=back @ m.inertia @ back.T,
        translation=back @ m.translation,
        rotation=back @ m.rotation,
        second=None if m.second is None else m.second.turned(back),
        nodes={name: node.seen_from(origin, back) for name, node in m.nodes.items()},
    )
    return replace(link, model=model)
