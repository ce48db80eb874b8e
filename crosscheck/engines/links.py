"""A scene of rigid bodies as peers want it: links depth-first, each on a chain of elementary joints.

A link's frame is the outboard hinge frame of its inboard hinge; wheels and moving point masses are links of their own
(the scene's body does not include them), point masses without freedom are part of their carrier.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from crosscheck.engines.conventions import (
    IDENTITY_FRAME,
    Frame,
    frame,
    inboard_frame,
    offset_frame,
    outboard_frame,
)
from flexmb.scene.bodies import ZERO
from flexmb.scene.connectors import Connector
from flexmb.scene.functions import Function
from flexmb.scene.schema import (
    AngularCoordinate,
    Body,
    Closure,
    Cylindrical,
    Free,
    Gimbal,
    Hinge,
    LinearCoordinate,
    Load,
    Marker,
    Planar,
    PointMass,
    Prismatic,
    Revolute,
    RigidBody,
    Scene,
    SidBody,
    Spherical,
    Universal,
    Vector,
    Wheel,
)
from flexmb.scene.tree import GROUND, coordinates, ordered
from flexmb.surrogate.lumping import Inertia, combine, inertia_of, rigid_equivalent
from flexmb.typing import Real

Kind = Literal["body", "wheel", "point mass"]
X: Vector = (1.0, 0.0, 0.0)
Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Scalar:
    """One turn about (or shift along) `axis`, in the axes that the freedoms before it have carried along.

    Units rad or m, Nm or N. `effort` is the motor, `prescribed` the motion of a driven coordinate.
    """

    angular: bool
    axis: Real
    value: float
    rate: float
    stiffness: float
    damping: float
    rest: float
    effort: Function | None
    prescribed: Function | None


@dataclass(frozen=True)
class Ball:
    """Quaternion wxyz and angular velocity in outboard axes; torque -stiffness * rotation vector - damping * omega."""

    quaternion: Real
    angular_velocity: Real
    stiffness: float = 0.0
    damping: float = 0.0


@dataclass(frozen=True)
class Floating:
    """Position of the outboard origin in inboard axes, quaternion; both velocities relative, in outboard axes."""

    position: Real
    quaternion: Real
    angular_velocity: Real
    velocity: Real


Freedom = Scalar | Ball | Floating


@dataclass(frozen=True)
class Link:
    """A rigid link. `parent` indexes the list of links (-1: World).

    `joint` names the hinge, wheel or point mass; `inboard` is the inboard hinge frame in the parent's link frame;
    `body` the scene body's frame in the link frame; `inertia` is in the link frame.
    """

    name: str
    kind: Kind
    joint: str
    parent: int
    inboard: Frame
    freedoms: tuple[Freedom, ...]
    inertia: Inertia
    body: Frame


@dataclass(frozen=True)
class Attachment:
    """A frame fixed to a link: a marker, or the node of a load."""

    link: int
    frame: Frame


def obstacle(
    scene: Scene, engine: str, closed_by: tuple[str, ...], connected_by: tuple[type[Connector], ...] = ()
) -> str:
    """Why an engine of rigid trees with some types of closures and connectors cannot represent the scene, or ""."""
    for closure in scene.closures:
        if not closed_by:
            return f'closure "{closure.name}": {engine} closes no loops'
        if closure.type not in closed_by:
            known = ", ".join(closed_by)
            return f'closure "{closure.name}" is of type {closure.type}: {engine} closes loops by {known} only'
    for connector in scene.connectors:
        if not isinstance(connector, connected_by):
            return f'connector "{connector.name}": the adapter of {engine} has none of its kind'
    for body in scene.bodies:
        if isinstance(body, SidBody):
            return f'body "{body.name}": its SID file is read by flexmb alone: convert it by flexmb import'
        if not isinstance(body, RigidBody) and body.level != "rigid":
            return f'{engine} has no flexible bodies ("{body.name}"): use the finite-segment surrogate'
    return ""


def links(scene: Scene) -> tuple[Link, ...]:
    """All links depth-first: a body, its point masses and wheels, then its children (every subtree is contiguous)."""
    bodies = {body.name: body for body in scene.bodies}
    chain: list[Link] = []
    index = {GROUND: -1}
    for body, hinge in ordered(scene):
        parent = index[hinge.parent]
        in_link = outboard_frame(hinge, body).inverse()
        inboard = inboard_frame(hinge, bodies.get(hinge.parent))
        if parent >= 0:
            inboard = chain[parent].body @ inboard
        fixed, moving = _point_masses(scene, body)
        lumps = [placed(_point(point), in_link @ _place(point, body)) for point in fixed]
        inertia = combine([placed(inertia_of(rigid_equivalent(body)), in_link), *lumps])
        index[body.name] = own = len(chain)
        chain.append(Link(body.name, "body", hinge.name, parent, inboard, freedoms(hinge), inertia, in_link))
        for point in moving:
            chain.append(_leaf(point, "point mass", own, in_link @ _place(point, body), _slides(point), _point(point)))
        for wheel in (wheel for wheel in scene.wheels if wheel.body == body.name):
            chain.append(_leaf(wheel, "wheel", own, in_link @ _place(wheel, body), (_spin(wheel),), _disc(wheel)))
    return tuple(chain)


def attachment(scene: Scene, chain: tuple[Link, ...], item: Marker | Load) -> Attachment:
    """Where a marker or the node of a load is fixed."""
    index = next(i for i, link in enumerate(chain) if link.kind == "body" and link.name == item.body)
    body = next(each for each in scene.bodies if each.name == item.body)
    offset = item.offset_m if isinstance(item, Marker) else ZERO
    return Attachment(index, chain[index].body @ offset_frame(body, item.node, offset))


def closed_frames(scene: Scene, chain: tuple[Link, ...], closure: Closure) -> tuple[Attachment, Attachment]:
    """Frames A and B of a closure, link -1 being World."""
    a = (closure.body_a, closure.node_a, frame(closure.position_a_m, closure.quaternion_a))
    b = (closure.body_b, closure.node_b, frame(closure.position_b_m, closure.quaternion_b))
    return _closed_frame(scene, chain, *a), _closed_frame(scene, chain, *b)


def _closed_frame(scene: Scene, chain: tuple[Link, ...], body: str, node: str, offset: Frame) -> Attachment:
    if body == GROUND:
        return Attachment(-1, offset)
    at = attachment(scene, chain, Marker(name="", body=body, node=node))
    return Attachment(at.link, at.frame @ offset)


def axes(hinge: Hinge) -> tuple[Vector, ...]:
    """Axis of every scalar coordinate, in the axes that the coordinates before it have carried along."""
    match hinge:
        case Revolute() | Prismatic():
            return (hinge.axis,)
        case Cylindrical():
            return hinge.axis, hinge.axis
        case Universal():
            return X, Y
        case Gimbal():
            return tuple({"x": X, "y": Y, "z": Z}[letter] for letter in hinge.sequence)
        case Planar():
            return X, Y, Z
    return ()


def freedoms(hinge: Hinge) -> tuple[Freedom, ...]:
    """The elementary joints of a hinge, base to tip; none for a weld."""
    match hinge:
        case Spherical():
            return (
                Ball(
                    np.array(hinge.quaternion),
                    np.array(hinge.angular_velocity_rad_s),
                    hinge.stiffness_Nm_rad,
                    hinge.damping_Nms_rad,
                ),
            )
        case Free():
            return (
                Floating(
                    np.array(hinge.position_m),
                    np.array(hinge.quaternion),
                    np.array(hinge.angular_velocity_rad_s),
                    np.array(hinge.velocity_m_s),
                ),
            )
    pairs = zip(axes(hinge), coordinates(hinge), strict=True)
    return tuple(_scalar(isinstance(c, AngularCoordinate), axis, c) for axis, (_, c) in pairs)


def _scalar(angular: bool, axis: Vector, coordinate: AngularCoordinate | LinearCoordinate) -> Scalar:
    match coordinate:
        case AngularCoordinate():
            numbers = (coordinate.angle_rad, coordinate.rate_rad_s, coordinate.stiffness_Nm_rad)
            rest = (coordinate.damping_Nms_rad, coordinate.rest_rad, coordinate.torque_Nm, coordinate.prescribed_rad)
        case LinearCoordinate():
            numbers = (coordinate.position_m, coordinate.rate_m_s, coordinate.stiffness_N_m)
            rest = (coordinate.damping_Ns_m, coordinate.rest_m, coordinate.force_N, coordinate.prescribed_m)
    return Scalar(angular, np.array(axis, dtype=float), *numbers, *rest)


def _spin(wheel: Wheel) -> Scalar:
    axis = np.array(wheel.axis, dtype=float)
    return Scalar(
        True, axis, wheel.angle_rad, wheel.speed_rad_s, 0.0, wheel.friction_Nms_rad, 0.0, wheel.torque_Nm,
        wheel.prescribed_rad,
    )  # fmt: skip


def _disc(wheel: Wheel) -> Inertia:
    a = np.array(wheel.axis, dtype=float)
    transverse = wheel.transverse_inertia_kg_m2
    about_axis = (wheel.axial_inertia_kg_m2 - transverse) * np.outer(a, a)
    return Inertia(wheel.mass_kg, np.zeros(3), transverse * np.eye(3) + about_axis)


def _point(point: PointMass) -> Inertia:
    return Inertia(point.mass_kg, np.zeros(3), np.zeros((3, 3)))


def _slides(point: PointMass) -> tuple[Scalar, ...]:
    pairs = zip(point.directions, coordinates(point), strict=True)
    return tuple(_scalar(False, direction, named.coordinate) for direction, named in pairs)


def _leaf(
    item: Wheel | PointMass, kind: Kind, parent: int, inboard: Frame, freedoms: tuple[Freedom, ...], inertia: Inertia
) -> Link:
    return Link(item.name, kind, item.name, parent, inboard, freedoms, inertia, IDENTITY_FRAME)


def _point_masses(scene: Scene, body: Body) -> tuple[list[PointMass], list[PointMass]]:
    """Point masses of a body without and with freedoms."""
    own = [point for point in scene.point_masses if point.body == body.name]
    return [point for point in own if not point.directions], [point for point in own if point.directions]


def _place(item: Wheel | PointMass, body: Body) -> Frame:
    return offset_frame(body, item.node, item.offset_m)


def placed(inertia: Inertia, frame: Frame) -> Inertia:
    """Inertia known in B, in A, with frame = X_AB."""
    R = frame.rotation
    return Inertia(inertia.mass, frame.position + R @ inertia.com, R @ inertia.inertia @ R.T)
