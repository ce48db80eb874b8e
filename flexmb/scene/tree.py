"""Reading a scene as a tree: bodies base to tip, rest frames of nodes, scalar coordinates of hinges by name, and the
ends of closures and of connectors between nodes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple, TypeVar, assert_never

import numpy as np
from msgspec.structs import replace

from flexmb.scene import control as c
from flexmb.scene.bodies import IDENTITY, ZERO, BeamBody, Body, ModalBody, Quaternion, RigidBody, SidBody, Vector
from flexmb.scene.connectors import AlongHinge, AngularFriction, BetweenNodes, sticks
from flexmb.scene.couplings import CoupledCoordinate, Coupling
from flexmb.scene.events import Dock, Impact, Separate
from flexmb.scene.freedoms import AngularCoordinate, Coordinate, LinearCoordinate
from flexmb.scene.hinges import Closure, Hinge
from flexmb.scene.keys import struct_keys
from flexmb.scene.quaternions import quaternion_of, rotation_matrix
from flexmb.scene.rest_curve import is_curved, rest_sections
from flexmb.scene.schema import PointMass, Scene, Wheel

GROUND = "ground"
Item = TypeVar("Item", bound=Hinge | PointMass)


class Branch(NamedTuple):
    """A body and its inboard hinge."""

    body: Body
    hinge: Hinge


class NodeFrame(NamedTuple):
    """Rest frame of a node in the body frame: `position` (m), `quaternion` maps node components to body components."""

    position: Vector
    quaternion: Quaternion


class NamedCoordinate(NamedTuple):
    """A scalar coordinate of a hinge or point mass under its schema key: "rotation", "rotations[1]", "x"."""

    name: str
    coordinate: Coordinate


def ordered(scene: Scene) -> tuple[Branch, ...]:
    """Bodies depth-first from the ground, each with its inboard hinge; siblings in the order of the scene's hinges.

    Every parent precedes its children, and every subtree is contiguous. Raises ValueError if the scene is not a tree.
    """
    bodies = {body.name: body for body in scene.bodies}
    outboard: dict[str, list[Hinge]] = {name: [] for name in (GROUND, *bodies)}
    for hinge in scene.hinges:
        if hinge.parent not in outboard or hinge.child not in bodies:
            raise ValueError(f'hinge "{hinge.name}" joins an unknown body: run check_scene for the details')
        outboard[hinge.parent].append(hinge)

    branches: list[Branch] = []
    waiting = outboard[GROUND][::-1]
    while waiting and len(branches) <= len(bodies):
        hinge = waiting.pop()
        branches.append(Branch(bodies[hinge.child], hinge))
        waiting.extend(reversed(outboard[hinge.child]))
    reached = {branch.body.name for branch in branches}
    if not len(reached) == len(branches) == len(scene.bodies):
        raise ValueError(f'scene "{scene.name}" is not a tree rooted at "ground": run check_scene for the details')
    return tuple(branches)


def rest_frames(body: Body) -> dict[str, NodeFrame]:
    """Rest frames of all nodes of a body by name, implicit ones included.

    Implicit nodes are "origin", the body frame (of rigid bodies, beams and clamped modal bodies), and "root" and "tip"
    of a beam. A free-free modal body has an "origin" only if it lists one. ValueError for a SID body, whose nodes are
    in its file.
    """
    origin = {"origin": NodeFrame(ZERO, IDENTITY)}
    match body:
        case RigidBody():
            return origin | {node.name: NodeFrame(node.position_m, node.quaternion) for node in body.nodes}
        case BeamBody():
            ends = {"root": origin["origin"], "tip": _on_beam(body, body.length_m, IDENTITY)}
            return origin | ends | {n.name: _on_beam(body, n.x_m, n.quaternion) for n in body.nodes}
        case ModalBody():
            listed = {node.name: NodeFrame(node.position_m, node.quaternion) for node in body.nodes}
            return (origin if body.boundary == "clamped-free" else {}) | listed
        case SidBody():
            what = f'the nodes of body "{body.name}" are in the SID file "{body.file}"'
            raise ValueError(f"{what}: convert it by flexmb import")
        case _:
            assert_never(body)


def node_names(body: Body) -> tuple[str, ...]:
    """Names of the nodes of `rest_frames`, in its order, without their frames; none of a SID body's."""
    match body:
        case RigidBody():
            implicit: tuple[str, ...] = ("origin",)
        case BeamBody():
            implicit = ("origin", "root", "tip")
        case ModalBody():
            implicit = ("origin",) if body.boundary == "clamped-free" else ()
        case SidBody():
            return ()
        case _:
            assert_never(body)
    return tuple(dict.fromkeys((*implicit, *(node.name for node in body.nodes))))


def nodes_along(beam: BeamBody) -> dict[str, float]:
    """Places (m) along the beam of all its nodes by name, implicit ones included."""
    return {"origin": 0.0, "root": 0.0, "tip": beam.length_m, **{node.name: node.x_m for node in beam.nodes}}


def _on_beam(body: BeamBody, x: float, quaternion: Quaternion) -> NodeFrame:
    """Rest frame of a node at x of a beam."""
    if not is_curved(body):
        return NodeFrame((x, 0.0, 0.0), quaternion)
    position, rotation = (section[0] for section in rest_sections(body, np.array([x])))
    at, turn = position.tolist(), quaternion_of(rotation @ rotation_matrix(quaternion)).tolist()
    return NodeFrame((at[0], at[1], at[2]), (turn[0], turn[1], turn[2], turn[3]))


def place_along(body: BeamBody, node: str) -> float:
    """Where a node of a beam is, in m along its axis from the root; ValueError if there is no such node."""
    places = nodes_along(body)
    if node not in places:
        raise ValueError(f'body "{body.name}" has no node "{node}"; its nodes are {", ".join(places)}')
    return places[node]


def node_frame(body: Body, node: str) -> NodeFrame:
    """Rest frame of `node` on `body`; ValueError, which lists the body's nodes, if there is no such node."""
    frames = rest_frames(body)
    if node not in frames:
        raise ValueError(f'body "{body.name}" has no node "{node}"; its nodes are {", ".join(frames)}')
    return frames[node]


def coordinates(item: Hinge | PointMass) -> tuple[NamedCoordinate, ...]:
    """Scalar coordinates of a hinge (or point mass) in the order of its speeds; none for weld, spherical and free.

    A point mass that lists directions only has default coordinates: at rest, without spring.
    """
    if isinstance(item, PointMass) and not item.coordinates:
        return tuple(NamedCoordinate(f"coordinates[{i}]", LinearCoordinate()) for i in range(len(item.directions)))
    coordinates: list[NamedCoordinate] = []
    for key in struct_keys(type(item)):  # a hinge holds no other structs
        match getattr(item, key):
            case AngularCoordinate() | LinearCoordinate() as coordinate:
                coordinates.append(NamedCoordinate(key, coordinate))
            case (AngularCoordinate() | LinearCoordinate(), *_) as several:
                coordinates.extend(NamedCoordinate(f"{key}[{i}]", each) for i, each in enumerate(several))
    return tuple(coordinates)


def with_coordinates(item: Item, changed: Iterable[Coordinate]) -> Item:
    """A hinge or point mass with other scalar coordinates, in the order of `coordinates`."""
    changes: dict[str, Any] = {}
    for (name, _), coordinate in zip(coordinates(item), changed, strict=True):
        key, bracket, _ = name.partition("[")
        changes[key] = (*changes.get(key, ()), coordinate) if bracket else coordinate
    return replace(item, **changes)


def scalar_paths(scene: Scene) -> dict[str, str]:
    """Names of scalar coordinates in states, "<hinge>.<key>" and "<wheel>.angle", and the paths of their structs.

    Paths are those of `Scene.with_values`.
    """
    paths = {}
    for collection in ("hinges", "point_masses"):
        for item in getattr(scene, collection):
            for name, _ in coordinates(item):
                key = name.replace("[", ".").rstrip("]")
                paths[f"{item.name}.{name}"] = f"{collection}.{item.name}.{key}"
    return paths | {f"{wheel.name}.angle": f"wheels.{wheel.name}" for wheel in scene.wheels}


def rate_name(coordinate: str, path: str) -> str:
    """The name in states of the rate of a scalar coordinate, from the name and the path in `scalar_paths`."""
    if path.startswith("wheels."):
        return f"{coordinate.removesuffix('.angle')}.speed"
    return f"{coordinate}.rate"


def coordinate_of(scene: Scene, connector: AlongHinge) -> tuple[Hinge | PointMass | Wheel, int]:
    """The item along whose coordinate a connector acts, and the number of the coordinate among its scalar ones.

    ValueError if there is none, or if the connector does not determine which.
    """
    items = {item.name: item for item in (*scene.hinges, *scene.point_masses, *scene.wheels)}
    sort = "angle" if connector.ANGULAR else "displacement"
    item = items.get(connector.hinge)
    if item is None:
        raise ValueError(f'there is no hinge, point mass or wheel "{connector.hinge}"')
    if isinstance(item, Wheel):
        if isinstance(connector, AngularFriction) and connector.coordinate in ("", "angle"):
            return item, 0
        raise ValueError(f'"{item.name}" is a wheel: of connectors along hinges only angular_friction acts on it')
    names = {
        name: n
        for n, (name, each) in enumerate(coordinates(item))
        if each.ANGULAR == connector.ANGULAR and connector.coordinate in ("", name)
    }
    if len(names) == 1:
        return item, next(iter(names.values()))
    if names:
        raise ValueError(f'"{item.name}" has more than one {sort}, {", ".join(names)}: say which coordinate is meant')
    raise ValueError(f'"{item.name}" has no {sort} "{connector.coordinate}"'.replace(' ""', ""))


class Coupled(NamedTuple):
    """A coordinate in a relation: its hinge, its number among the hinge's scalar ones, and its factor in the relation
    sum of factor_i q_i = offset."""

    hinge: Hinge
    place: int
    named: NamedCoordinate
    factor: float


def coupled(scene: Scene, coupling: Coupling) -> tuple[Coupled, ...]:
    """The coordinates of a coupling, the one that is led first; ValueError where one is not determined."""
    hinges = {hinge.name: hinge for hinge in scene.hinges}
    led = _coupled(hinges, coupling, 1.0)
    return led, *(_coupled(hinges, term, -term.ratio) for term in coupling.terms)


def _coupled(hinges: dict[str, Hinge], item: Coupling | CoupledCoordinate, factor: float) -> Coupled:
    hinge = hinges.get(item.hinge)
    if hinge is None:
        raise ValueError(f'there is no hinge "{item.hinge}"')
    scalar = coordinates(hinge)
    candidates = [(n, each) for n, each in enumerate(scalar) if item.coordinate in ("", each.name)]
    if len(candidates) == 1:
        return Coupled(hinge, *candidates[0], factor)
    names = ", ".join(coordinate.name for coordinate in scalar)
    if not scalar:
        raise ValueError(f'hinge "{item.hinge}" of type {hinge.__struct_config__.tag} has no scalar coordinate')
    if candidates:
        raise ValueError(f'hinge "{item.hinge}" has more than one coordinate, {names}: say which is meant')
    raise ValueError(f'hinge "{item.hinge}" has no coordinate "{item.coordinate}"; it has {names}')


def watches_signals(scene: Scene) -> bool:
    """Whether any event watches, or may later watch (the load of a stop or of friction that sticks), a signal of a
    sensor or controller."""
    if any(map(sticks, scene.connectors)):
        return True
    if not scene.events:
        return False
    rests = any(isinstance(action, Impact) and action.rests for event in scene.events for action in event.actions)
    return rests or not {event.watch for event in scene.events} <= set(watchable(scene))


def opens(scene: Scene) -> bool:
    """Whether any event opens a closure: what it suppresses may be free later."""
    return any(isinstance(action, Separate) for event in scene.events for action in event.actions)


def closes(scene: Scene) -> bool:
    """Whether any event closes a closure: its frames may be anywhere before."""
    return any(isinstance(action, Dock) for event in scene.events for action in event.actions)


def watchable(scene: Scene) -> dict[str, str]:
    """Quantities that events can watch without evaluating sensors: "time", scalar coordinates and their rates, by name.

    Sensors of time, or of the only coordinate of a hinge, wheel or point mass, are included: their names map to the
    quantity that they measure.
    """
    paths = scalar_paths(scene)
    found = {"time": "time"} | {name: name for name in paths}
    found |= {rate: rate for rate in (rate_name(name, path) for name, path in paths.items())}
    for sensor in scene.sensors:
        match sensor:
            case c.TimeSensor():
                found[sensor.name] = "time"
            case c.CoordinateSensor():
                own = [name for name in paths if name.startswith(f"{sensor.of}.")]
                if len(own) == 1:
                    found[sensor.name] = own[0] if sensor.quantity == "value" else rate_name(own[0], paths[own[0]])
            case c.MarkerSensor() | c.DistanceSensor() | c.LoadSensor() | c.DriveSensor() | c.ProfileSensor():
                pass  # these are known from a look at them alone
            case _:
                assert_never(sensor)
    return found


class EndFrame(NamedTuple):
    """A frame with fixed offsets from a node of a body, in node axes, or from World where `body` is the ground."""

    body: str
    node: str
    position_m: Vector
    quaternion: Quaternion


def joined_bodies(scene: Scene) -> dict[str, tuple[str, str]]:
    """The bodies that each hinge and closure joins, by its name: its load is that on the second one."""
    hinges = {hinge.name: (hinge.parent, hinge.child) for hinge in scene.hinges}
    return hinges | {closure.name: (closure.body_a, closure.body_b) for closure in scene.closures}


def ends(item: Closure | BetweenNodes) -> tuple[EndFrame, EndFrame]:
    """Frames A and B; where the item joins points only, the frames have the axes of their nodes."""
    return _end(item, "a"), _end(item, "b")


def _end(item: Closure | BetweenNodes, side: str) -> EndFrame:
    return EndFrame(
        getattr(item, f"body_{side}"),
        getattr(item, f"node_{side}"),
        getattr(item, f"position_{side}_m"),
        getattr(item, f"quaternion_{side}", IDENTITY),
    )
