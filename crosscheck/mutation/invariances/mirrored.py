"""Reflection of z: polar vectors such as positions and forces are reflected, axial ones with the opposite sign.

Every frame of the scene is reflected and made right-handed again by the opposite z axis: the mirror image by S of a
rotation R is S R S. A vector's components become S v where it is polar, -S v where it is axial.
"""

from __future__ import annotations

from typing import Any, TypeVar

import msgspec
import numpy as np

from crosscheck.library.time_functions import scaled
from crosscheck.mutation.invariances.counterpart import (
    Channels,
    Counterpart,
    Invariance,
    NotApplicable,
    by_kind,
    without_events,
    without_feedback,
)
from crosscheck.mutation.invariances.linearised import Item, by_freedom, relation
from flexmb.scene.bodies import BeamStation, ModalBody, ModalNode, SidBody
from flexmb.scene.connectors import BetweenNodes, Bushing
from flexmb.scene.freedoms import Coordinate, ScalarFreedom
from flexmb.scene.functions import Function
from flexmb.scene.hinges import WITH_AXIS, Closure, Hinge
from flexmb.scene.schema import Coupling, Load, PointMass, Scene, Wheel
from flexmb.scene.tree import coordinate_of, coordinates, coupled, with_coordinates
from flexmb.surrogate import modal_points
from flexmb.typing import Real

M = TypeVar("M", bound=Hinge | PointMass | Wheel)
S = TypeVar("S", bound=Bushing | BeamStation)
POLAR_SIGNS = (1.0, 1.0, -1.0)
AXIAL_SIGNS = (-1.0, -1.0, 1.0)
QUATERNION_SIGNS = (1.0, *AXIAL_SIGNS)
POLAR_KEYS = (
    "gravity_m_s2", "com_m", "position_m", "offset_m", "com_offset_m", "parent_position_m", "child_position_m",
    "position_a_m", "position_b_m", "velocity_m_s", "translation_modes", "second_translation",
)  # fmt: skip
AXIAL_KEYS = ("angular_velocity_rad_s", "rotation_modes", "second_rotation", "curvature_1_m")
SCREW_KEYS = ("pitch_m_rad",)
QUATERNION_KEYS = ("quaternion", "parent_quaternion", "child_quaternion", "quaternion_a", "quaternion_b")


def _mirrored(scene: Scene) -> Counterpart:
    without_feedback(scene)
    without_events(scene)
    for body in scene.bodies:
        if isinstance(body, SidBody) or (isinstance(body, ModalBody) and body.file is not None):
            raise NotApplicable(f'body "{body.name}" keeps its numbers in a file')
    for connector in scene.connectors:
        item = None if isinstance(connector, BetweenNodes) else coordinate_of(scene, connector)[0]
        if item is not None and min(_signs(item), default=1.0) < 0.0:
            raise NotApplicable(f'a coordinate of what connector "{connector.name}" acts on counts the other way')
    if scene.modal_states:  # which of a beam's modes are odd in z is known when the model is made
        scene = modal_points(scene)
    polar, axial, quaternion = (np.array(signs) for signs in (POLAR_SIGNS, AXIAL_SIGNS, QUATERNION_SIGNS))
    drives = {}
    for item in (*scene.hinges, *scene.point_masses):
        pairs = zip(coordinates(item), _signs(item), strict=True)
        drives[item.name] = np.array([sign for (_, coordinate), sign in pairs if coordinate.prescribed is not None])

    def back(times: Real, channels: Channels) -> Channels:
        channels_back = by_kind(
            channels, lambda rows: rows * polar, lambda rows: rows * axial, lambda q: q * quaternion
        )
        return {
            name: rows * drives.get(name.partition(":")[2], 1.0) if name.startswith("drive:") else rows
            for name, rows in channels_back.items()
        }

    other = msgspec.structs.replace(_reflected(scene), couplings=_couplings(scene))
    return Counterpart(other, back, linear=relation(scene, other, _ratios))


def _ratios(item: Item) -> list[float]:
    """1 for each displacement of an item that counts on in the mirror, -1 for one that counts back."""
    signs = _signs(item)
    return by_freedom(item, lambda _, place: signs[place], AXIAL_SIGNS, POLAR_SIGNS)


def _couplings(scene: Scene) -> tuple[Coupling, ...]:
    """Relations of the coordinates as the mirror counts them."""
    couplings = []
    for coupling in scene.couplings:
        led, *leading = (_signs(member.hinge)[member.place] for member in coupled(scene, coupling))
        terms = tuple(
            msgspec.structs.replace(term, ratio=led * own * term.ratio)
            for term, own in zip(coupling.terms, leading, strict=True)
        )
        couplings.append(msgspec.structs.replace(coupling, terms=terms, offset=led * coupling.offset + 0.0))
    return tuple(couplings)


def _reflected(item: Any) -> Any:
    """The mirror image of a struct with all structs in it."""
    if isinstance(item, Hinge | PointMass):
        counted = zip(coordinates(item), _signs(item), strict=True)
        changed = [coordinate if sign > 0.0 else _opposite(coordinate) for (_, coordinate), sign in counted]
        item = with_coordinates(item, changed)
    if isinstance(item, Hinge | PointMass | Wheel):
        item = _with_axes(item)
    changes = {key: _value(key, getattr(item, key)) for key in item.__struct_fields__}
    item = msgspec.structs.replace(item, **changes)
    match item:
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
            return _with_matrices(item, AXIAL_SIGNS + POLAR_SIGNS, "stiffness", "damping")
        case BeamStation():
            y, z = item.reference_point_m
            item = msgspec.structs.replace(item, reference_point_m=(y, -z + 0.0))
            return _with_matrices(item, POLAR_SIGNS + AXIAL_SIGNS, "stiffness", "inertia")
        case Closure() if item.type in WITH_AXIS:  # which has no sense of rotation
            return msgspec.structs.replace(item, axis=_signed(item.axis, POLAR_SIGNS))
    return item


def _with_matrices(item: S, signs: tuple[float, ...], *keys: str) -> S:
    """An item with its matrices (6,6) under these keys as the mirror shows them, those that it has."""
    given = {key: value for key in keys if (value := getattr(item, key)) is not None}
    seen = {key: np.array(value) * np.outer(signs, signs) + 0.0 for key, value in given.items()}
    return msgspec.structs.replace(item, **{key: tuple(map(tuple, rows.tolist())) for key, rows in seen.items()})


def _with_axes(item: M) -> M:
    """An item with its own axes as the mirror shows them: polar where something slides along them, axial where it only
    turns. A right-handed screw is a left-handed one."""
    slides = any(isinstance(freedom, ScalarFreedom) and freedom.motion == "slide" for freedom in item.freedoms)
    changes: dict[str, Any] = {}
    for key in item.__struct_fields__:
        value = getattr(item, key)
        if key == "directions":  # three are right-handed: in the mirror all point the other way
            changes[key] = _signed(value, AXIAL_SIGNS if len(value) == 3 else POLAR_SIGNS)
        elif key == "axis":
            changes[key] = _signed(value, POLAR_SIGNS if slides else AXIAL_SIGNS)
        elif key in SCREW_KEYS:
            changes[key] = -value
    return msgspec.structs.replace(item, **changes)


def _signs(item: Hinge | PointMass | Wheel) -> list[float]:
    """By scalar coordinate, 1 where it counts on in the mirror, -1 where it counts back.

    The mirror shows the axis of a turn as axial, that of a shift as polar; the item's own may be the opposite one.
    """
    signs = []
    for own, image in zip(item.freedoms, _with_axes(item).freedoms, strict=True):
        if isinstance(own, ScalarFreedom) and isinstance(image, ScalarFreedom):
            if image.pitch != -own.pitch:
                raise NotApplicable(f'hinge "{item.name}" has a hand, and no key that changes it')
            seen = _signed(own.axis, POLAR_SIGNS if own.motion == "slide" else AXIAL_SIGNS)
            signs.append(1.0 if np.dot(seen, image.axis) > 0.0 else -1.0)
    return signs


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
        return tuple(_reflected(element) for element in value)
    return value


def _signed(value: Any, signs: tuple[float, ...]) -> Any:
    """Signs on the components of a vector, or of vectors in tuples however deep; no zero gets a sign."""
    if value and isinstance(value[0], tuple):
        return tuple(_signed(element, signs) for element in value)
    return tuple(sign * number + 0.0 for sign, number in zip(signs, value, strict=False))


def _times(matrix: Any, sign: float) -> Any:
    return tuple(tuple(sign * number for number in row) for row in matrix)


def _opposite(coordinate: Coordinate) -> Coordinate:
    """A coordinate with the opposite sign: where it starts and rests, its motor and its prescribed motion."""
    keys, rest = coordinate.KEYS, coordinate.SPRING[2]
    numbers = {key: -getattr(coordinate, key) for key in (keys.value, keys.rate, rest)}
    functions = {keys.effort: coordinate.effort, keys.prescribed: coordinate.prescribed}
    driven = {key: scaled(function, -1.0) for key, function in functions.items() if function is not None}
    return msgspec.structs.replace(coordinate, **numbers, **driven)


MIRRORED = Invariance("mirrored", "seen in a mirror", _mirrored)
