"""From scene to links: every body (point masses too) with its inboard hinge, in the frame the dynamics uses.

A link's frame is the outboard frame of its hinge, turned so that a hinge axis is z; only where that hinge sits on a
node that deforms does the link keep the modal frame of its body.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, assert_never

import numpy as np

from flexmb.building.models import ORIGIN, Models, level_of, one_point
from flexmb.hinges.catalogue import kind_of
from flexmb.hinges.kind import HingeKind, Reduced, z_to
from flexmb.kept import kept
from flexmb.levels.body import BY_NAME
from flexmb.levels.level import FidelityLevel
from flexmb.modal.flexible_model import FlexibleModel, FlexibleNode
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY, ZERO
from flexmb.scene.hinges import WITH_AXIS
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.tree import NamedCoordinate, coordinates, ordered
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


_RIGID = s.RigidBody, s.PointMass


class End(NamedTuple):
    """Where a hinge frame is: a node of a body and the fixed offsets from it, in node axes."""

    node: str
    offset: s.Vector
    quaternion: s.Quaternion


@dataclass(eq=False)
class BodyLink:
    """One body as the dynamics sees it, and the hinge that holds it.

    `axes`: axis, sequence and parameters of the hinge as its kernels take them. The last `wheels` points of the model
    are the despun wheels of the body. Models and ports are made at the first access: rigid bodies rarely need them.
    """

    name: str
    hinge: s.Hinge | s.PointMass
    parent: str
    level: FidelityLevel
    kind: HingeKind
    axes: Reduced
    inboard_end: End
    outboard_end: End
    body: s.Body | s.PointMass
    models: Models

    @property
    def turn(self) -> Real:
        """Rotation (3,3) by which both frames of the hinge are turned, so that its axis is z."""
        return self.axes.turn

    @property
    def is_rigid(self) -> bool:
        """Whether it is a rigid body or a point mass of the scene."""
        return isinstance(self.body, _RIGID)

    @property
    def mass_properties(self) -> tuple[float, s.Vector, s.Matrix3]:
        """Mass, mass centre and inertia about it of a rigid link without its wheels, in the body's own frame."""
        match self.body:
            case s.RigidBody(mass_kg=mass, com_m=com, inertia_kg_m2=inertia):
                return mass, com, inertia
            case s.PointMass(mass_kg=mass):
                return mass, ZERO, (ZERO, ZERO, ZERO)
            case s.BeamBody() | s.ModalBody() | s.SidBody():
                raise ValueError(f'"{self.name}" is no rigid link')
            case _:
                assert_never(self.body)

    @property
    def wheels(self) -> int:
        """How many wheels the body carries."""
        return 0 if isinstance(self.body, s.PointMass) else len(self.models.wheels.get(self.name, ()))

    @kept
    def mode_count(self) -> int:
        """Modes of the body at its level."""
        return 0 if self.is_rigid else self.models[self.name].mode_count

    @property
    def scalar(self) -> tuple[NamedCoordinate, ...]:
        """Scalar coordinates of the hinge."""
        return coordinates(self.hinge)

    @kept
    def inboard(self) -> Port:
        """The inboard hinge frame on the parent, in the parent's own frame."""
        return port(self.models.node(self.parent, self.inboard_end.node), *self.inboard_end[1:], self.turn)

    @kept
    def outboard(self) -> Port:
        """The outboard hinge frame on the body, in the body's own frame."""
        return port(self._own_node(self.outboard_end.node), *self.outboard_end[1:], self.turn)

    def _own_node(self, name: str) -> FlexibleNode:
        return ORIGIN if isinstance(self.body, s.PointMass) else self.models.node(self.name, name)

    def node(self, name: str) -> FlexibleNode:
        """A node of the body, in the frame of the link."""
        node = self._own_node(name)
        return node if self.outboard.deforms else node.seen_from(self.outboard.origin, self.outboard.frame.T)

    @kept
    def model(self) -> FlexibleModel:
        """Inertia points and modes, in the frame of the link."""
        if isinstance(self.body, s.PointMass):
            m = one_point(*self.mass_properties, {"origin": ORIGIN})
        else:
            m = self.models[self.name]
        at = self.outboard
        return m if at.deforms else _seen_from(m, tuple(at.origin.tolist()), tuple(at.frame.ravel().tolist()))


@lru_cache(maxsize=64)
def _seen_from(m: FlexibleModel, origin: tuple[float, ...], frame: tuple[float, ...]) -> FlexibleModel:
    """The model in the frame (3,3) at an origin (3,). Equal beams on equal hinges share the result: see
    `flexible_model`."""
    back, at = np.reshape(frame, (3, 3)).T, np.array(origin)
    return replace(
        m,
        position=(m.position - at) @ back.T,
        com_offset=m.com_offset @ back.T,
        inertia=back @ m.inertia @ back.T,
        translation=back @ m.translation,
        rotation=back @ m.rotation,
        second=None if m.second is None else m.second.turned(back),
        nodes={name: node.seen_from(at, back) for name, node in m.nodes.items()},
        field=None if m.field is None else m.field.seen_from(at, back),
    )


def links(scene: s.Scene, like: s.Scene | None = None) -> list[BodyLink]:
    """All links base to tip: bodies depth-first, then point masses. `like`: see `Models`.

    NotImplementedError for SID bodies.
    """
    models = Models(scene, like)
    followed = {} if like is None else {item.name: item for item in (*like.hinges, *like.point_masses)}
    links = []
    for body, hinge in ordered(scene):
        kind, axes = _kind(hinge, followed.get(hinge.name))
        inboard = End(hinge.parent_node, hinge.parent_position_m, hinge.parent_quaternion)
        outboard = End(hinge.child_node, hinge.child_position_m, hinge.child_quaternion)
        level, parent = level_of(body), hinge.parent
        if isinstance(body, s.SidBody):
            models[body.name]  # raises the NotImplementedError
        links.append(BodyLink(body.name, hinge, parent, level, kind, axes, inboard, outboard, body, models))
    return links + [_point_mass(mass, models, followed.get(mass.name)) for mass in scene.point_masses]


def _kind(item: s.Hinge | s.PointMass, like: s.Hinge | s.PointMass | None) -> tuple[HingeKind, Reduced]:
    """The kind and the axes of a hinge; a single axis is turned to z as that of `like` is."""
    kind, axes = kind_of(item)
    own, followed = _axis(item), None if like is None else _axis(like)
    return kind, axes if own is None or followed is None else axes._replace(turn=z_to(own, followed))


def _axis(item: s.Hinge | s.PointMass) -> s.Vector | None:
    """The axis of its own that a hinge or point mass has."""
    if isinstance(item, s.PointMass):
        return item.directions[0] if len(item.directions) == 1 else None
    return getattr(item, "axis", None)


def _point_mass(mass: s.PointMass, models: Models, like: s.Hinge | s.PointMass | None) -> BodyLink:
    """A point mass as a body without rotary inertia on translations along its directions."""
    kind, axes = _kind(mass, like)
    inboard, outboard = End(mass.node, mass.offset_m, IDENTITY), End("origin", ZERO, IDENTITY)
    return BodyLink(mass.name, mass, mass.body, BY_NAME["rigid"], kind, axes, inboard, outboard, mass, models)


@dataclass(frozen=True)
class Side:
    """Where frame A or B of a closure is: a node of a body, fixed offsets, and the turn that brings the axis to z."""

    body: str
    node: str
    offset: s.Vector
    quaternion: s.Quaternion
    turn: Real

    def port(self, link: BodyLink) -> Port:
        """The frame on a body, as the dynamics sees it."""
        return port(link.node(self.node), self.offset, self.quaternion, self.turn)


def sides_of_closures(scene: s.Scene, like: s.Scene | None = None) -> list[tuple[s.Closure, tuple[Side, Side]]]:
    """The closures of a scene, each with its frames A and B. `like`: see `links`."""
    followed = [None] * len(scene.closures) if like is None else [closure.axis for closure in like.closures]
    return [(closure, closure_sides(closure, axis)) for closure, axis in zip(scene.closures, followed, strict=True)]


def closure_sides(closure: s.Closure, like: s.Vector | None = None) -> tuple[Side, Side]:
    """Frames A and B of a closure; `like`: an axis around which they are smooth functions of its axis."""
    turn = z_to(closure.axis, like) if closure.type in WITH_AXIS else np.eye(3)
    return (
        Side(closure.body_a, closure.node_a, closure.position_a_m, closure.quaternion_a, turn),
        Side(closure.body_b, closure.node_b, closure.position_b_m, closure.quaternion_b, turn),
    )


def port(at: FlexibleNode, offset: s.Vector, quaternion: s.Quaternion, turn: Real) -> Port:
    """The frame at `offset`, `quaternion` from a node, turned once more by `turn`."""
    return Port(at, at.rotation @ np.asarray(offset, float), at.rotation @ rotation_matrix(quaternion) @ turn)
