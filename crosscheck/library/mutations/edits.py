"""Changes of scenes by mutations: replacing one named item, and listing the targets of a scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any, TypeVar

import msgspec
import numpy as np
from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.mutation import FACTOR, MutationTarget, SceneChange
from flexmb.scene.bodies import BeamBody, BeamNode, BeamStation, Body, ModalNode, Node, Quaternion, SidBody, Vector
from flexmb.scene.hinges import Hinge
from flexmb.scene.schema import Scene
from flexmb.scene.sections import inertia_matrices, mass_centres, matrix
from flexmb.scene.tree import Coordinate, coordinates, with_coordinates

AnyNode = Node | BeamNode | ModalNode
Struct = TypeVar("Struct", bound=msgspec.Struct)


def _of(collection: str) -> Callable[[Callable[[Any], Any]], SceneChange]:
    """A decorator by which the change of one item becomes that of the item with the name `target` in a scene."""

    def of_item(change: Callable[[Any], Any]) -> SceneChange:
        def changed(scene: Scene, target: str) -> Scene:
            return replace(scene, **{collection: replaced(getattr(scene, collection), target, change)})

        return changed

    return of_item


of_body, of_hinge, of_wheel, of_load = _of("bodies"), _of("hinges"), _of("wheels"), _of("loads")
of_closure, of_connector, of_point_mass = _of("closures"), _of("connectors"), _of("point_masses")
of_coupling = _of("couplings")
of_sensor, of_controller, of_event = _of("sensors"), _of("controllers"), _of("events")


def of_coordinates(change: Callable[[Coordinate], Coordinate]) -> SceneChange:
    """The same for each scalar coordinate of a hinge."""
    return of_hinge(lambda hinge: with_each_coordinate(hinge, change))


def of_node(change: Callable[[AnyNode], AnyNode]) -> SceneChange:
    """The same for the node "body.node" (only body names may contain dots here)."""

    def changed(scene: Scene, target: str) -> Scene:
        body_name, _, node_name = target.rpartition(".")

        def with_node(body: Body) -> Body:
            if isinstance(body, SidBody):
                raise CaseError(f'body "{body.name}" keeps its nodes in a file: this mutation needs them inline')
            nodes = tuple(change(node) if node.name == node_name else node for node in body.nodes)
            return replace(body, nodes=nodes)

        return of_body(with_node)(scene, body_name)

    return changed


def replaced(items: tuple[Any, ...], target: str, change: Callable[[Any], Any]) -> tuple[Any, ...]:
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

    return replace(item, **{key: times(getattr(item, key)) for key in keys})


def more(of_item: Callable[[Callable[[Any], Any]], SceneChange], *keys: str) -> SceneChange:
    """+1 % of an item's numbers under these keys."""
    return of_item(lambda item: multiplied(item, keys, FACTOR))


def scaled_stations(beam: BeamBody, keys: Iterable[str], change: Callable[[BeamStation], BeamStation]) -> BeamBody:
    """+1 % of the numbers under these keys at every station of a beam, and `change` where it has a matrix instead."""
    stations = tuple(change(multiplied(station, keys, FACTOR)) for station in beam.stations)
    return replace(beam, stations=stations)


def stiffer(station: BeamStation) -> BeamStation:
    """+1 % of the stiffness, where that is a matrix."""
    return station if station.stiffness is None else replace(station, stiffness=scaled(station.stiffness))


def heavier(mass: float, inertia: float) -> Callable[[BeamStation], BeamStation]:
    """Mass, and inertia about the mass centre, times factors, where they are a matrix."""

    def change(station: BeamStation) -> BeamStation:
        if station.inertia is None:
            return station
        m, com, J = mass_centres(np.array([station.inertia]))
        return replace(station, inertia=matrix(inertia_matrices(mass * m, com, inertia * J)[0]))

    return change


def opposite(vector: Vector) -> Vector:
    return (-vector[0], -vector[1], -vector[2])


def conjugated(item: Struct, *keys: str) -> Struct:
    """A struct with its quaternions under these keys conjugated, which transposes their rotations."""

    def conjugate(quaternion: Quaternion) -> Quaternion:
        return (quaternion[0], -quaternion[1], -quaternion[2], -quaternion[3])

    return replace(item, **{key: conjugate(getattr(item, key)) for key in keys})


def _tag(item: Body | Hinge) -> str:
    return str(item.__struct_config__.tag)
