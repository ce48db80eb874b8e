"""Negative controls: deliberate faults of a scene that a comparison must notice.

Each mutation is what a convention error or a slip in the data would do. A mutation that leaves the scene as it was is
refused, since a control that changes nothing cannot be noticed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import msgspec

from crosscheck.library.case import CaseError, MutationKind
from flexmb.scene.bodies import BeamBody, Body, ModalBody, Quaternion, RigidBody, SidBody
from flexmb.scene.hinges import Hinge
from flexmb.scene.schema import Scene, Wheel
from flexmb.scene.tree import coordinates

FACTOR = 1.01
Named = TypeVar("Named", Body, Hinge, Wheel)


def mutate(scene: Scene, mutation: MutationKind, target: str) -> Scene:
    """The scene with one deliberate fault; CaseError where there is no such target or nothing would change."""
    changed = _MUTATIONS[mutation](scene, target)
    if changed == scene:
        raise CaseError(f'control "{mutation}" of "{target}" changes nothing in scene "{scene.name}": choose another')
    return changed


def _mass(scene: Scene, target: str) -> Scene:
    """+1 % mass, inertia untouched (a beam: mass per length)."""

    def heavier(body: Body) -> Body:
        match body:
            case RigidBody():
                return msgspec.structs.replace(body, mass_kg=FACTOR * body.mass_kg)
            case BeamBody():
                return _scaled_stations(body, ("mass_per_length_kg_m",))
            case ModalBody() if body.points:
                return _scaled_points(body, "mass_kg")
        raise CaseError(f'body "{body.name}" keeps its mass in a file: control "mass" needs it inline')

    return _on_body(scene, target, heavier)


def _inertia(scene: Scene, target: str) -> Scene:
    """+1 % inertia about the mass centre."""

    def stiffer_to_turn(body: Body) -> Body:
        match body:
            case RigidBody():
                return msgspec.structs.replace(body, inertia_kg_m2=_scaled(body.inertia_kg_m2))
            case BeamBody():
                return _scaled_stations(body, ("rotary_y_kg_m", "rotary_z_kg_m"))
        raise CaseError(f'control "inertia" changes rigid bodies and beams, not "{body.name}"')

    return _on_body(scene, target, stiffer_to_turn)


def _com(scene: Scene, target: str) -> Scene:
    """+1 % offset of the mass centre from the body frame."""

    def shifted(body: Body) -> Body:
        if isinstance(body, RigidBody):
            return msgspec.structs.replace(body, com_m=_scaled(body.com_m))
        raise CaseError(f'control "com" changes rigid bodies, not "{body.name}"')

    return _on_body(scene, target, shifted)


def _hinge_axis(scene: Scene, target: str) -> Scene:
    """Opposite sign of the hinge axis."""

    def reversed_axis(hinge: Hinge) -> Hinge:
        if not hasattr(hinge, "axis"):
            raise CaseError(f'hinge "{hinge.name}" has no axis: control "hinge_axis" needs one')
        return msgspec.structs.replace(hinge, axis=_opposite(hinge.axis))

    return msgspec.structs.replace(scene, hinges=_replaced(scene.hinges, target, reversed_axis))


def _hinge_rotation(scene: Scene, target: str) -> Scene:
    """Transposed rotations between the hinge's frames and its nodes."""

    def transposed(hinge: Hinge) -> Hinge:
        return msgspec.structs.replace(
            hinge,
            parent_quaternion=_conjugate(hinge.parent_quaternion),
            child_quaternion=_conjugate(hinge.child_quaternion),
        )

    return msgspec.structs.replace(scene, hinges=_replaced(scene.hinges, target, transposed))


def _node_rotation(scene: Scene, target: str) -> Scene:
    """Transposed rotation of node "body.node" (body names may hold dots, node names may not here)."""
    body_name, _, node_name = target.rpartition(".")

    def transposed(body: Body) -> Body:
        if isinstance(body, SidBody):
            raise CaseError(f'body "{body.name}" keeps its nodes in a file: control "node_rotation" needs them inline')
        nodes = tuple(
            msgspec.structs.replace(node, quaternion=_conjugate(node.quaternion)) if node.name == node_name else node
            for node in body.nodes
        )
        return msgspec.structs.replace(body, nodes=nodes)

    return _on_body(scene, body_name, transposed)


def _gravity_sign(scene: Scene, target: str) -> Scene:
    """Opposite gravity."""
    return msgspec.structs.replace(scene, gravity_m_s2=_opposite(scene.gravity_m_s2))


def _wheel_axis(scene: Scene, target: str) -> Scene:
    """Opposite sign of the wheel's spin axis."""

    def reversed_axis(wheel: Wheel) -> Wheel:
        return msgspec.structs.replace(wheel, axis=_opposite(wheel.axis))

    return msgspec.structs.replace(scene, wheels=_replaced(scene.wheels, target, reversed_axis))


def _stiffness(scene: Scene, target: str) -> Scene:
    """+1 % stiffness of a flexible body, or of all springs of a hinge."""
    if any(body.name == target for body in scene.bodies):
        return _on_body(scene, target, _stiffer_body)
    return msgspec.structs.replace(scene, hinges=_replaced(scene.hinges, target, _stiffer_hinge))


def _dropped_stiffening(scene: Scene, target: str) -> Scene:
    """Geometric stiffening left out: level stiffened becomes full (of body `target`, or of all)."""

    def unstiffened(body: Body) -> Body:
        wanted = target in ("", body.name) and not isinstance(body, RigidBody) and body.level == "stiffened"
        return msgspec.structs.replace(body, level="full") if wanted else body

    return msgspec.structs.replace(scene, bodies=tuple(map(unstiffened, scene.bodies)))


_MUTATIONS: dict[MutationKind, Callable[[Scene, str], Scene]] = {
    "mass": _mass,
    "inertia": _inertia,
    "com": _com,
    "hinge_axis": _hinge_axis,
    "hinge_rotation": _hinge_rotation,
    "node_rotation": _node_rotation,
    "gravity_sign": _gravity_sign,
    "wheel_axis": _wheel_axis,
    "stiffness": _stiffness,
    "dropped_stiffening": _dropped_stiffening,
}


def _stiffer_body(body: Body) -> Body:
    match body:
        case BeamBody():
            return _scaled_stations(body, ("EA_N", "EIy_Nm2", "EIz_Nm2", "GJ_Nm2"))
        case ModalBody() if body.stiffness:
            return msgspec.structs.replace(body, stiffness=_scaled(body.stiffness))
    raise CaseError(f'control "stiffness" changes beams, inline modal bodies and hinge springs, not "{body.name}"')


def _stiffer_hinge(hinge: Hinge) -> Hinge:
    """Every spring of the hinge: of its scalar coordinates, or of the whole (spherical)."""
    if hasattr(hinge, "stiffness_Nm_rad"):
        return msgspec.structs.replace(hinge, stiffness_Nm_rad=FACTOR * hinge.stiffness_Nm_rad)
    single: dict[str, msgspec.Struct] = {}
    several: dict[str, tuple[msgspec.Struct, ...]] = {}
    for name, coordinate in coordinates(hinge):
        key = next(key for key in coordinate.__struct_fields__ if key.startswith("stiffness"))
        stiffer = msgspec.structs.replace(coordinate, **{key: FACTOR * getattr(coordinate, key)})
        field, numbered, _ = name.partition("[")
        if numbered:
            several[field] = (*several.get(field, ()), stiffer)
        else:
            single[field] = stiffer
    return msgspec.structs.replace(hinge, **single, **several)


def _on_body(scene: Scene, target: str, change: Callable[[Body], Body]) -> Scene:
    return msgspec.structs.replace(scene, bodies=_replaced(scene.bodies, target, change))


def _replaced(items: tuple[Named, ...], target: str, change: Callable[[Named], Named]) -> tuple[Named, ...]:
    if all(item.name != target for item in items):
        raise CaseError(f'control names "{target}", but there are only {", ".join(item.name for item in items)}')
    return tuple(change(item) if item.name == target else item for item in items)


def _scaled_stations(body: BeamBody, keys: tuple[str, ...]) -> BeamBody:
    stations = tuple(
        msgspec.structs.replace(station, **{key: FACTOR * getattr(station, key) for key in keys})
        for station in body.stations
    )
    return msgspec.structs.replace(body, stations=stations)


def _scaled_points(body: ModalBody, key: str) -> ModalBody:
    points = tuple(msgspec.structs.replace(point, **{key: FACTOR * getattr(point, key)}) for point in body.points)
    return msgspec.structs.replace(body, points=points)


def _scaled(values: tuple) -> tuple:
    return tuple(_scaled(value) if isinstance(value, tuple) else FACTOR * value for value in values)


def _opposite(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    return (-vector[0], -vector[1], -vector[2])


def _conjugate(quaternion: Quaternion) -> Quaternion:
    return (quaternion[0], -quaternion[1], -quaternion[2], -quaternion[3])
