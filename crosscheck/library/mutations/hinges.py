"""Mutations of hinges: of their axes, springs and dampers, and of initial states."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import assert_never

import msgspec
import numpy as np

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import (
    bodies,
    conjugate,
    hinges,
    key_of,
    on_body,
    on_hinge,
    opposite,
    scaled,
    with_each_coordinate,
)
from crosscheck.library.mutations.mutation import DROPPED, FACTOR, OPPOSITE, Mutation, MutationTarget
from flexmb.scene.bodies import BeamBody, Body, ModalBody, RigidBody, SidBody
from flexmb.scene.hinges import Free, Gimbal, Hinge, Spherical
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.schema import Scene
from flexmb.scene.tree import Coordinate, coordinates
from flexmb.scene.units import split_unit

DEGREE = math.pi / 180.0
ROUNDING = 1e-15


def _hinge_axis(scene: Scene, target: str) -> Scene:
    def reversed_axis(hinge: Hinge) -> Hinge:
        if not hasattr(hinge, "axis"):
            raise CaseError(f'hinge "{hinge.name}" has no axis: control "hinge_axis" needs one')
        return msgspec.structs.replace(hinge, axis=opposite(hinge.axis))

    return on_hinge(scene, target, reversed_axis)


def _reversal_is_a_name(scene: Scene, target: str) -> str:
    """Reversing the sign of a coordinate has no effect if nothing depends on the sign."""
    hinge = next(hinge for hinge in scene.hinges if hinge.name == target)
    if any(getattr(each, "hinge", "") == target for each in scene.connectors):
        return ""
    for _, coordinate in coordinates(hinge):
        driven = coordinate.effort is not None or coordinate.prescribed is not None
        if driven or coordinate.rate or coordinate.spring[2] or _has_a_side(coordinate):
            return ""
    return "it starts at rest at zero, its spring too, without motor: the sign of the axis only names the coordinate"


def _has_a_side(coordinate: Coordinate) -> bool:
    """Whether the initial place is another on the opposite axis: a half-turn is not, but for a spring."""
    if coordinate.ANGULAR and not coordinate.spring[0]:
        return abs(math.sin(coordinate.value)) > ROUNDING
    return coordinate.value != 0.0


def _gimbal_order(scene: Scene, target: str) -> Scene:
    def reversed_order(hinge: Hinge) -> Hinge:
        if not isinstance(hinge, Gimbal):
            raise CaseError(f'hinge "{hinge.name}" is no gimbal: control "gimbal_order" needs one')
        return msgspec.structs.replace(hinge, sequence=hinge.sequence[::-1])

    return on_hinge(scene, target, reversed_order)


def _stiffness(scene: Scene, target: str) -> Scene:
    """+1 % stiffness of a flexible body, or of all springs of a hinge."""
    if any(body.name == target for body in scene.bodies):
        return on_body(scene, target, _stiffer_body)
    return on_hinge(scene, target, lambda hinge: _hinge_constant(hinge, "stiffness", FACTOR))


def _stiffer_body(body: Body) -> Body:
    match body:
        case BeamBody():
            keys = ("EA_N", "EIy_Nm2", "EIz_Nm2", "GJ_Nm2")
            stations = tuple(
                msgspec.structs.replace(station, **{key: FACTOR * getattr(station, key) for key in keys})
                for station in body.stations
            )
            return msgspec.structs.replace(body, stations=stations)
        case ModalBody() if body.stiffness:
            return msgspec.structs.replace(body, stiffness=scaled(body.stiffness))
        case RigidBody() | ModalBody() | SidBody():
            what = f'control "stiffness" changes beams, inline modal bodies and hinge springs, not "{body.name}"'
            raise CaseError(what)
        case _:
            assert_never(body)


def _damping(factor: float) -> Callable[[Scene, str], Scene]:
    """Damping of a flexible body, or of all dampers of a hinge or wheel, times a factor."""

    def of_body(body: Body) -> Body:
        match body:
            case BeamBody():
                ratio = body.modes.damping_ratio
                less = tuple(factor * each for each in ratio) if isinstance(ratio, tuple) else factor * ratio
                return msgspec.structs.replace(body, modes=msgspec.structs.replace(body.modes, damping_ratio=less))
            case ModalBody() if body.damping:
                return msgspec.structs.replace(body, damping=scaled(body.damping, factor))
            case RigidBody() | ModalBody() | SidBody():
                raise CaseError(f'body "{body.name}" has no damping whose size this mutation can change')
            case _:
                assert_never(body)

    def changed(scene: Scene, target: str) -> Scene:
        if any(body.name == target for body in scene.bodies):
            return on_body(scene, target, of_body)
        if any(wheel.name == target for wheel in scene.wheels):
            wheels = tuple(
                msgspec.structs.replace(each, friction_Nms_rad=factor * each.friction_Nms_rad)
                if each.name == target
                else each
                for each in scene.wheels
            )
            return msgspec.structs.replace(scene, wheels=wheels)
        return on_hinge(scene, target, lambda hinge: _hinge_constant(hinge, "damping", factor))

    return changed


def _hinge_constant(hinge: Hinge, stem: str, factor: float) -> Hinge:
    """Every spring or damper of the hinge: of its scalar coordinates, and of the whole (spherical)."""
    whole = [key for key in hinge.__struct_fields__ if split_unit(key)[0] == stem]
    hinge = msgspec.structs.replace(hinge, **{key: factor * getattr(hinge, key) for key in whole})

    def changed(coordinate: Coordinate) -> Coordinate:
        key = key_of(coordinate, stem)
        return msgspec.structs.replace(coordinate, **{key: factor * getattr(coordinate, key)})

    return with_each_coordinate(hinge, changed)


def _armature(scene: Scene, target: str) -> Scene:
    """Every armature of a hinge left out."""
    return on_hinge(scene, target, lambda hinge: _hinge_constant(hinge, "armature", DROPPED))


def _rest(scene: Scene, target: str) -> Scene:
    def unloaded(coordinate: Coordinate) -> Coordinate:
        return msgspec.structs.replace(coordinate, **{key_of(coordinate, "rest"): 0.0})

    return on_hinge(scene, target, lambda hinge: with_each_coordinate(hinge, unloaded))


def _slack(scene: Scene, target: str) -> str:
    hinge = next(hinge for hinge in scene.hinges if hinge.name == target)
    sprung = any(each.spring[0] for _, each in coordinates(hinge))
    return "" if sprung else "it has no spring that could be at rest somewhere"


def _initial(stem: str, factor: float) -> Callable[[Scene, str], Scene]:
    """Initial values ("place") or rates of the coordinates that are not prescribed, times a factor."""

    def changed(coordinate: Coordinate) -> Coordinate:
        if coordinate.prescribed is not None:
            return coordinate
        key = coordinate.KEYS.value if stem == "place" else key_of(coordinate, stem)
        return msgspec.structs.replace(coordinate, **{key: factor * getattr(coordinate, key)})

    return lambda scene, target: on_hinge(scene, target, lambda hinge: with_each_coordinate(hinge, changed))


def _initial_unit(scene: Scene, target: str) -> Scene:
    def in_degrees(coordinate: Coordinate) -> Coordinate:
        if not coordinate.ANGULAR or coordinate.prescribed is not None:
            return coordinate
        return msgspec.structs.replace(coordinate, **{coordinate.KEYS.value: DEGREE * coordinate.value})

    return on_hinge(scene, target, lambda hinge: with_each_coordinate(hinge, in_degrees))


def _initial_speed_sign(scene: Scene, target: str) -> Scene:
    def reversed_speed(hinge: Hinge) -> Hinge:
        if not isinstance(hinge, Free | Spherical):
            return hinge
        return msgspec.structs.replace(hinge, angular_velocity_rad_s=opposite(hinge.angular_velocity_rad_s))

    return on_hinge(_initial("rate", OPPOSITE)(scene, target), target, reversed_speed)


def _speed_axes(scene: Scene, target: str) -> Scene:
    """Speeds given in outboard axes read as if in inboard axes."""

    def turned(hinge: Hinge) -> Hinge:
        if not isinstance(hinge, Free | Spherical):
            raise CaseError(f'the speeds of hinge "{hinge.name}" have no axes: "speed_axes" needs a free or ball joint')
        R = rotation_matrix(hinge.quaternion)
        names = {"angular_velocity_rad_s", "velocity_m_s"} & set(hinge.__struct_fields__)
        return msgspec.structs.replace(
            hinge, **{name: tuple(map(float, np.asarray(getattr(hinge, name)) @ R)) for name in names}
        )

    return on_hinge(scene, target, turned)


def _attitude(scene: Scene, target: str) -> Scene:
    def transposed(hinge: Hinge) -> Hinge:
        if not isinstance(hinge, Free | Spherical):
            raise CaseError(f'hinge "{hinge.name}" has no quaternion: "initial_attitude" needs a free or ball joint')
        return msgspec.structs.replace(hinge, quaternion=conjugate(hinge.quaternion))

    return on_hinge(scene, target, transposed)


def _sprung(scene: Scene) -> list[MutationTarget]:
    return [*bodies(scene), *hinges(scene)]


def _damped(scene: Scene) -> list[MutationTarget]:
    return [*bodies(scene), *hinges(scene), *(MutationTarget(wheel.name, "wheel") for wheel in scene.wheels)]


MUTATIONS = (
    Mutation(
        "hinge_axis",
        "opposite hinge axis",
        "a sign: left-hand for right-hand",
        hinges,
        _hinge_axis,
        _reversal_is_a_name,
    ),
    Mutation("gimbal_order", "rotations of a gimbal in the opposite order", "xyz for zyx", hinges, _gimbal_order),
    Mutation("stiffness", "+1 % stiffness of a body or of a hinge's springs", "a wrong figure", _sprung, _stiffness),
    Mutation("spring_rest", "springs at rest at zero", "the rest value left out", hinges, _rest, _slack),
    Mutation("damping", "+1 % damping", "a wrong figure", _damped, _damping(FACTOR)),
    Mutation("damping_dropped", "no damping", "dissipation left out", _damped, _damping(DROPPED)),
    Mutation("armature_dropped", "no armatures", "the rotors of drives left out", hinges, _armature),
    Mutation(
        "initial_place", "+1 % initial angle or displacement", "a wrong figure", hinges, _initial("place", FACTOR)
    ),
    Mutation("initial_unit", "initial angle times pi/180", "degrees expected, radians given", hinges, _initial_unit),
    Mutation("initial_rate", "+1 % initial rate", "a wrong figure", hinges, _initial("rate", FACTOR)),
    Mutation("initial_speed_sign", "opposite initial rotation or rate", "a sign", hinges, _initial_speed_sign),
    Mutation(
        "speed_axes",
        "initial speeds in outboard axes read in inboard axes",
        "body rates taken for space rates",
        hinges,
        _speed_axes,
    ),
    Mutation(
        "initial_attitude", "conjugate initial quaternion", "body to World taken for World to body", hinges, _attitude
    ),
)
