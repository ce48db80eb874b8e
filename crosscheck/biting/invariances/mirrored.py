"""Reflection of z: polar vectors such as positions and forces are reflected, axial ones with the opposite sign.

Every frame of the scene is reflected and made right-handed again by the opposite z axis: the mirror image by S of a
rotation R is S R S. A vector's components become S v where it is polar, -S v where it is axial.
"""

from __future__ import annotations

from typing import Any, TypeVar

import msgspec
import numpy as np

from crosscheck.biting.invariances.counterpart import (
    Channels,
    Counterpart,
    Invariance,
    NotApplicable,
    by_kind,
    is_prescribed,
    without_events,
    without_feedback,
)
from crosscheck.library.time_functions import scaled
from flexmb.scene.bodies import ModalBody, ModalNode, SidBody
from flexmb.scene.connectors import BetweenNodes, Bushing
from flexmb.scene.functions import Function
from flexmb.scene.hinges import (
    WITH_AXIS,
    AngularCoordinate,
    Closure,
    Cylindrical,
    Gimbal,
    Hinge,
    LinearCoordinate,
    Prismatic,
    Revolute,
    Universal,
)
from flexmb.scene.schema import Load, PointMass, Scene, Wheel
from flexmb.scene.tree import coordinate_of, coordinates
from flexmb.surrogate import modal_points
from flexmb.typing import Real

C = TypeVar("C", AngularCoordinate, LinearCoordinate)
POLAR_SIGNS = (1.0, 1.0, -1.0)
AXIAL_SIGNS = (-1.0, -1.0, 1.0)
QUATERNION_SIGNS = (1.0, *AXIAL_SIGNS)
POLAR_KEYS = (
    "gravity_m_s2", "com_m", "position_m", "offset_m", "com_offset_m", "parent_position_m", "child_position_m",
    "position_a_m", "position_b_m", "velocity_m_s", "directions", "translation_modes", "second_translation",
)  # fmt: skip
AXIAL_KEYS = ("angular_velocity_rad_s", "rotation_modes", "second_rotation")
QUATERNION_KEYS = ("quaternion", "parent_quaternion", "child_quaternion", "quaternion_a", "quaternion_b")


def _mirrored(scene: Scene) -> Counterpart:
    without_feedback(scene)
    without_events(scene)
    for body in scene.bodies:
        if isinstance(body, SidBody) or (isinstance(body, ModalBody) and body.file is not None):
            raise NotApplicable(f'body "{body.name}" keeps its numbers in a file')
    for connector in scene.connectors:
        item = None if isinstance(connector, BetweenNodes) else coordinate_of(scene, connector)[0]
        if isinstance(item, Cylindrical | Universal | Gimbal | PointMass):
            raise NotApplicable(f'the coordinate of connector "{connector.name}" may count the other way in a mirror')
    if scene.modal_states:  # which of a beam's modes are odd in z is known when the model is made
        scene = modal_points(scene)
    polar, axial, quaternion = (np.array(signs) for signs in (POLAR_SIGNS, AXIAL_SIGNS, QUATERNION_SIGNS))
    drives = {item.name: _drive_signs(item) for item in (*scene.hinges, *scene.point_masses)}

    def back(times: Real, channels: Channels) -> Channels:
        found = by_kind(channels, lambda rows: rows * polar, lambda rows: rows * axial, lambda q: q * quaternion)
        return {
            name: rows * drives.get(name.partition(":")[2], 1.0) if name.startswith("drive:") else rows
            for name, rows in found.items()
        }

    return Counterpart(_reflected(scene), back)


def _reflected(item: Any) -> Any:
    """The mirror image of a struct with all structs in it."""
    changes = {key: _value(key, getattr(item, key)) for key in item.__struct_fields__}
    item = msgspec.structs.replace(item, **changes)
    match item:
        case Revolute() | Wheel():
            return msgspec.structs.replace(item, axis=_signed(item.axis, AXIAL_SIGNS))
        case Prismatic():
            return msgspec.structs.replace(item, axis=_signed(item.axis, POLAR_SIGNS))
        case Cylindrical():  # its axis serves the translation, so that the rotation about it is the opposite one
            axis = _signed(item.axis, POLAR_SIGNS)
            return msgspec.structs.replace(item, axis=axis, rotation=_opposite(item.rotation))
        case Universal():
            return msgspec.structs.replace(item, first=_opposite(item.first), second=_opposite(item.second))
        case Gimbal():
            turns = zip(item.sequence, item.rotations, strict=True)
            rotations = tuple(each if letter == "z" else _opposite(each) for letter, each in turns)
            return msgspec.structs.replace(item, rotations=rotations)
        case PointMass() if len(item.directions) == 3:  # three are right-handed: all point the other way
            opposite = _signed(item.directions, (-1.0, -1.0, -1.0))
            return msgspec.structs.replace(
                item, directions=opposite, coordinates=tuple(map(_opposite, item.coordinates))
            )
        case Load():
            signs = POLAR_SIGNS if item.type == "force" else AXIAL_SIGNS
            return msgspec.structs.replace(item, direction=_signed(item.direction, signs))
        case ModalBody():
            gravity = tuple(_times(m, s) for m, s in zip(item.gravity_stiffness, POLAR_SIGNS, strict=False))
            gradient = tuple(
                tuple(_times(m, a * b) for m, b in zip(row, POLAR_SIGNS, strict=True))
                for row, a in zip(item.gradient_stiffness, POLAR_SIGNS, strict=False)
            )
            return msgspec.structs.replace(item, gravity_stiffness=gravity, gradient_stiffness=gradient)
        case ModalNode():
            force = tuple(_times(m, s) for m, s in zip(item.force_stiffness, POLAR_SIGNS, strict=False))
            return msgspec.structs.replace(item, force_stiffness=force)
        case Bushing():
            both = np.outer(*(2 * (AXIAL_SIGNS + POLAR_SIGNS,)))
            matrices = (np.array(item.stiffness) * both + 0.0, np.array(item.damping) * both + 0.0)
            K, D = (tuple(map(tuple, each.tolist())) for each in matrices)
            return msgspec.structs.replace(item, stiffness=K, damping=D)
        case Closure() if item.type in WITH_AXIS:  # which has no sense of rotation
            return msgspec.structs.replace(item, axis=_signed(item.axis, POLAR_SIGNS))
    return item


def _value(key: str, value: Any) -> Any:
    if key in POLAR_KEYS:
        return value if isinstance(value, float) else _signed(value, POLAR_SIGNS)  # position_m of a coordinate
    if key in AXIAL_KEYS:
        return _signed(value, AXIAL_SIGNS)
    if key in QUATERNION_KEYS:
        return _signed(value, QUATERNION_SIGNS)
    if key == "inertia_kg_m2":
        return tuple(
            _signed(row, tuple(s * sign for s in POLAR_SIGNS)) for row, sign in zip(value, POLAR_SIGNS, strict=True)
        )
    if isinstance(value, Function):
        return value
    if isinstance(value, msgspec.Struct):
        return _reflected(value)
    if isinstance(value, tuple) and value and isinstance(value[0], msgspec.Struct):
        return tuple(_reflected(each) for each in value)
    return value


def _signed(value: Any, signs: tuple[float, ...]) -> Any:
    """Signs on the components of a vector, or of vectors in tuples however deep; no zero gets a sign."""
    if value and isinstance(value[0], tuple):
        return tuple(_signed(each, signs) for each in value)
    return tuple(sign * number + 0.0 for sign, number in zip(signs, value, strict=False))


def _times(matrix: Any, sign: float) -> Any:
    return tuple(tuple(sign * number for number in row) for row in matrix)


def _opposite(coordinate: C) -> C:
    """A coordinate with the opposite sign: where it starts and rests, its motor and its prescribed motion."""
    changes: dict[str, Any] = {}
    for key in coordinate.__struct_fields__:
        value = getattr(coordinate, key)
        if key.startswith(("angle", "position", "rate", "rest")):
            changes[key] = -value
        elif isinstance(value, Function):
            changes[key] = scaled(value, -1.0)
    return msgspec.structs.replace(coordinate, **changes)


def _drive_signs(item: Hinge | PointMass) -> Real:
    """The signs of the drive loads of a hinge or a point mass, one for each prescribed coordinate."""
    found = []
    for place, (_, each) in enumerate(coordinates(item)):
        angular = isinstance(each, AngularCoordinate)
        if not is_prescribed(each):
            continue
        match item:
            case PointMass():
                opposite = len(item.directions) == 3
            case Universal():
                opposite = True
            case Cylindrical():
                opposite = angular
            case Gimbal():
                opposite = item.sequence[place] != "z"
            case _:
                opposite = False
        found.append(-1.0 if opposite else 1.0)
    return np.array(found)


MIRRORED = Invariance("mirrored", "seen in a mirror", _mirrored)
