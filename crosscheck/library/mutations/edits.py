"""Changes of scenes by mutations: replacing one named item, and listing the targets of a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

import msgspec

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.mutation import FACTOR, MutationTarget
from flexmb.scene.bodies import BeamNode, Body, ModalNode, Node, Quaternion, SidBody, Vector
from flexmb.scene.connectors import Connector
from flexmb.scene.control import Controller, Sensor
from flexmb.scene.events import SceneEvent
from flexmb.scene.hinges import Closure, Hinge
from flexmb.scene.schema import Coupling, Load, PointMass, Scene, Wheel
from flexmb.scene.tree import Coordinate, coordinates, with_coordinates

AnyNode = Node | BeamNode | ModalNode
Struct = TypeVar("Struct", bound=msgspec.Struct)
Named = TypeVar(
    "Named", Body, Hinge, Wheel, Load, Closure, Coupling, Connector, PointMass, Sensor, Controller, SceneEvent
)


def on_body(scene: Scene, target: str, change: Callable[[Body], Body]) -> Scene:
    return msgspec.structs.replace(scene, bodies=replaced(scene.bodies, target, change))


def on_hinge(scene: Scene, target: str, change: Callable[[Hinge], Hinge]) -> Scene:
    return msgspec.structs.replace(scene, hinges=replaced(scene.hinges, target, change))


def on_wheel(scene: Scene, target: str, change: Callable[[Wheel], Wheel]) -> Scene:
    return msgspec.structs.replace(scene, wheels=replaced(scene.wheels, target, change))


def on_load(scene: Scene, target: str, change: Callable[[Load], Load]) -> Scene:
    return msgspec.structs.replace(scene, loads=replaced(scene.loads, target, change))


def on_closure(scene: Scene, target: str, change: Callable[[Closure], Closure]) -> Scene:
    return msgspec.structs.replace(scene, closures=replaced(scene.closures, target, change))


def on_coupling(scene: Scene, target: str, change: Callable[[Coupling], Coupling]) -> Scene:
    return msgspec.structs.replace(scene, couplings=replaced(scene.couplings, target, change))


def on_connector(scene: Scene, target: str, change: Callable[[Any], Any]) -> Scene:
    return msgspec.structs.replace(scene, connectors=replaced(scene.connectors, target, change))


def on_sensor(scene: Scene, target: str, change: Callable[[Any], Any]) -> Scene:
    return msgspec.structs.replace(scene, sensors=replaced(scene.sensors, target, change))


def on_controller(scene: Scene, target: str, change: Callable[[Controller], Controller]) -> Scene:
    return msgspec.structs.replace(scene, controllers=replaced(scene.controllers, target, change))


def on_event(scene: Scene, target: str, change: Callable[[SceneEvent], SceneEvent]) -> Scene:
    return msgspec.structs.replace(scene, events=replaced(scene.events, target, change))


def on_node(scene: Scene, target: str, change: Callable[[AnyNode], AnyNode]) -> Scene:
    """The scene with node "body.node" changed (only body names may contain dots here)."""
    body_name, _, node_name = target.rpartition(".")

    def with_node(body: Body) -> Body:
        if isinstance(body, SidBody):
            raise CaseError(f'body "{body.name}" keeps its nodes in a file: this mutation needs them inline')
        nodes = tuple(change(node) if node.name == node_name else node for node in body.nodes)
        return msgspec.structs.replace(body, nodes=nodes)

    return on_body(scene, body_name, with_node)


def replaced(items: tuple[Named, ...], target: str, change: Callable[[Named], Named]) -> tuple[Named, ...]:
    """The items with the one called `target` changed; CaseError lists the names."""
    if all(item.name != target for item in items):
        known = ", ".join(item.name for item in items) or "none"
        raise CaseError(f'control names "{target}", but there are only {known}')
    return tuple(change(item) if item.name == target else item for item in items)


def with_each_coordinate(hinge: Hinge, change: Callable[[Coordinate], Coordinate]) -> Hinge:
    """The hinge with each of its scalar coordinates changed; none has a weld, a spherical and a free hinge."""
    return with_coordinates(hinge, (change(coordinate) for _, coordinate in coordinates(hinge)))


def key_of(coordinate: Coordinate, stem: str) -> str:
    """The key of a coordinate that begins with `stem`, whatever its unit: "stiffness", "prescribed"."""
    return next(key for key in coordinate.__struct_fields__ if key.startswith(stem))


def whole(scene: Scene) -> Iterator[MutationTarget]:
    yield MutationTarget("", "scene")


def bodies(scene: Scene) -> Iterator[MutationTarget]:
    yield from (MutationTarget(body.name, _tag(body)) for body in scene.bodies)


def hinges(scene: Scene) -> Iterator[MutationTarget]:
    yield from (MutationTarget(hinge.name, _tag(hinge)) for hinge in scene.hinges)


def wheels(scene: Scene) -> Iterator[MutationTarget]:
    yield from (MutationTarget(wheel.name, "wheel") for wheel in scene.wheels)


def loads(scene: Scene) -> Iterator[MutationTarget]:
    yield from (MutationTarget(load.name, f"{load.type} in {load.frame} axes") for load in scene.loads)


def closures(scene: Scene) -> Iterator[MutationTarget]:
    yield from (MutationTarget(closure.name, f"{closure.type} closure") for closure in scene.closures)


def point_masses(scene: Scene) -> Iterator[MutationTarget]:
    yield from (MutationTarget(mass.name, "point mass") for mass in scene.point_masses)


def nodes(scene: Scene) -> Iterator[MutationTarget]:
    for body in scene.bodies:
        if not isinstance(body, SidBody):
            yield from (MutationTarget(f"{body.name}.{node.name}", f"node of {_tag(body)}") for node in body.nodes)


def scaled(values: tuple, factor: float = FACTOR) -> tuple:
    """Numbers in nested tuples, multiplied."""
    return tuple(scaled(value, factor) if isinstance(value, tuple) else factor * value for value in values)


def multiplied(item: Struct, keys: Iterable[str], factor: float) -> Struct:
    """A struct with its numbers under some keys, alone or in tuples, multiplied."""

    def times(value: Any) -> Any:
        if value is None:
            return None
        return scaled(value, factor) if isinstance(value, tuple) else factor * value

    return msgspec.structs.replace(item, **{key: times(getattr(item, key)) for key in keys})


def opposite(vector: Vector) -> Vector:
    return (-vector[0], -vector[1], -vector[2])


def conjugate(quaternion: Quaternion) -> Quaternion:
    return (quaternion[0], -quaternion[1], -quaternion[2], -quaternion[3])


def _tag(item: Body | Hinge) -> str:
    return str(item.__struct_config__.tag)
