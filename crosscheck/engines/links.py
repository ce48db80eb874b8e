"""A scene of rigid bodies as peers want it: links depth-first, each on a chain of elementary joints.

A link's frame is the outboard hinge frame of its inboard hinge; wheels and moving point masses are links of their own
(the scene's body does not include them), point masses without freedom are part of their carrier.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeVar, assert_never

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
from flexmb.scene.connectors import BetweenNodes, Connector
from flexmb.scene.freedoms import Ball, Floating, ScalarFreedom
from flexmb.scene.functions import Function
from flexmb.scene.rigid_equivalent import Inertia, combine, rest_inertia, wheel_inertia
from flexmb.scene.schema import (
    Body,
    Closure,
    Hinge,
    Load,
    Marker,
    PointMass,
    Scene,
    SidBody,
    Wheel,
)
from flexmb.scene.tree import GROUND, EndFrame, coordinates, ends, ordered
from flexmb.typing import Real

Kind = Literal["body", "wheel", "point mass"]
JointMotion = Literal["turn", "slide", "screw"]
T = TypeVar("T")


@dataclass(frozen=True)
class Scalar:
    """A joint of one coordinate about or along `axis`, in the axes that the freedoms before it have carried along.

    Units rad or m, N m or N, kg m^2 or kg. A screw turns, and shifts by `pitch` (m/rad) times its angle. `effort` is
    the motor, `prescribed` the motion of a driven coordinate.
    """

    motion: JointMotion
    axis: Real
    pitch: float
    value: float
    rate: float
    stiffness: float
    damping: float
    rest: float
    armature: float
    effort: Function | None
    prescribed: Function | None


Freedom = Scalar | Ball | Floating


def by_motion(joint: Scalar, turn: T, slide: T) -> T:
    """What an adapter without screws takes for a joint that turns, or slides; NotImplementedError for a screw."""
    match joint.motion:
        case "turn":
            return turn
        case "slide":
            return slide
        case "screw":
            raise NotImplementedError("a screw joint, which `obstacle` refuses, has reached the adapter")
        case _:
            assert_never(joint.motion)


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
    scene: Scene, engine: str, closed_by: tuple[str, ...], connected_by: tuple[type[Connector], ...] = (),
    screws: bool = False, couplings: bool = False, armatures: bool = False,
) -> str:  # fmt: skip
    """Why an engine of rigid trees with some types of closures and connectors cannot represent the scene, or "".

    `screws`, `couplings`, `armatures`: whether the adapter offers screw joints, linear relations of coordinates, and
    armatures of coordinates.
    """
    if scene.couplings and not couplings:
        return f'coupling "{scene.couplings[0].name}": the adapter of {engine} relates no coordinates'
    for closure in scene.closures:
        if not closed_by:
            return f'closure "{closure.name}": {engine} closes no loops'
        if closure.type not in closed_by:
            known = ", ".join(closed_by)
            return f'closure "{closure.name}" is of type {closure.type}: {engine} closes loops by {known} only'
    for connector in scene.connectors:
        if not isinstance(connector, connected_by):
            return f'connector "{connector.name}": the adapter of {engine} has none of its kind'
    screw = "" if screws else first_screw(scene)
    if screw:
        return f'hinge "{screw}" is a screw: the adapter of {engine} offers no such joint'
    armed = "" if armatures else first_armature(scene)
    if armed:
        return f'coordinate "{armed}" has an armature: the adapter of {engine} offers none'
    for body in scene.bodies:
        if isinstance(body, SidBody):
            return f'body "{body.name}": its SID file is read by flexmb alone: convert it by flexmb import'
        if body.level != "rigid":
            return f'{engine} has no flexible bodies ("{body.name}"): use the finite-segment surrogate'
    return ""


def first_screw(scene: Scene) -> str:
    """The first hinge that turns and shifts by one coordinate, "" where there is none."""
    for hinge in scene.hinges:
        if any(isinstance(freedom, ScalarFreedom) and freedom.motion == "screw" for freedom in hinge.freedoms):
            return hinge.name
    return ""


def first_armature(scene: Scene) -> str:
    """The first coordinate of a hinge or a point mass that has an armature, "" where there is none."""
    for item in (*scene.hinges, *scene.point_masses):
        for name, coordinate in coordinates(item):
            if coordinate.armature:
                return f"{item.name}.{name}"
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
        inertia = combine([placed(rest_inertia(body), in_link), *lumps])
        index[body.name] = own = len(chain)
        chain.append(Link(body.name, "body", hinge.name, parent, inboard, freedoms(hinge), inertia, in_link))
        for point in moving:
            chain.append(_leaf(point, "point mass", own, in_link @ _place(point, body), freedoms(point), _point(point)))
        for wheel in (wheel for wheel in scene.wheels if wheel.body == body.name):
            chain.append(_leaf(wheel, "wheel", own, in_link @ _place(wheel, body), freedoms(wheel), _disc(wheel)))
    return tuple(chain)


def attachment(scene: Scene, chain: tuple[Link, ...], item: Marker | Load) -> Attachment:
    """Where a marker or the node of a load is fixed."""
    index = next(i for i, link in enumerate(chain) if link.kind == "body" and link.name == item.body)
    body = next(body for body in scene.bodies if body.name == item.body)
    offset = item.offset_m if isinstance(item, Marker) else ZERO
    return Attachment(index, chain[index].body @ offset_frame(body, item.node, offset))


def is_bare_frame(link: Link) -> bool:
    """Whether a link is welded to what carries it and has no inertia, as most robots have a base and a tool."""
    return not link.freedoms and link.inertia.mass == 0.0 and not np.any(link.inertia.inertia)


def radius_of_gyration(chain: tuple[Link, ...], at: Attachment) -> float:
    """m, of a link about a frame on it; that of the link which carries it for a frame without inertia, 0 for World."""
    index, place = at.link, at.frame
    while index >= 0 and is_bare_frame(chain[index]):
        index, place = chain[index].parent, chain[index].inboard @ place
    if index < 0 or chain[index].inertia.mass == 0.0:
        return 0.0
    own = chain[index].inertia
    arm = own.com - place.position
    return float(np.sqrt(0.5 * np.trace(own.inertia) / own.mass + arm @ arm))


def closed_frames(scene: Scene, chain: tuple[Link, ...], item: Closure | BetweenNodes) -> tuple[Attachment, Attachment]:
    """Frames A and B of a closure or of a connector, link -1 being World."""
    a, b = ends(item)
    return _closed_frame(scene, chain, a), _closed_frame(scene, chain, b)


def _closed_frame(scene: Scene, chain: tuple[Link, ...], end: EndFrame) -> Attachment:
    offset = frame(end.position_m, end.quaternion)
    if end.body == GROUND:
        return Attachment(-1, offset)
    at = attachment(scene, chain, Marker(name="", body=end.body, node=end.node))
    return Attachment(at.link, at.frame @ offset)


def freedoms(item: Hinge | PointMass | Wheel) -> tuple[Freedom, ...]:
    """The elementary joints of a hinge, a point mass or a wheel, base to tip; none for a weld."""
    return tuple(_scalar(freedom) if isinstance(freedom, ScalarFreedom) else freedom for freedom in item.freedoms)


def _scalar(freedom: ScalarFreedom) -> Scalar:
    c, axis = freedom.coordinate, np.array(freedom.axis, dtype=float)
    return Scalar(freedom.motion, axis, freedom.pitch, c.value, c.rate, *c.spring, c.armature, c.effort, c.prescribed)


def _disc(wheel: Wheel) -> Inertia:
    return Inertia(wheel.mass_kg, np.zeros(3), wheel_inertia(wheel))


def _point(point: PointMass) -> Inertia:
    return Inertia(point.mass_kg, np.zeros(3), np.zeros((3, 3)))


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
