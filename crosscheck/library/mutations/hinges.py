"""Mutations of hinges: of their axes, springs and dampers, and of initial states."""

from __future__ import annotations

import math
from typing import assert_never

import numpy as np
from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import (
    bodies,
    conjugated,
    hinges,
    key_of,
    multiplied,
    of_body,
    of_coordinates,
    of_hinge,
    of_wheel,
    opposite,
    scaled,
    scaled_stations,
    stiffer,
    wheels,
    with_each_coordinate,
)
from crosscheck.library.mutations.mutation import DROPPED, FACTOR, OPPOSITE, Mutation, MutationTarget, SceneChange
from flexmb.scene.bodies import BeamBody, Body, ModalBody, RigidBody, SidBody
from flexmb.scene.hinges import Free, Gimbal, Hinge, Spherical
from flexmb.scene.keys import split_unit
from flexmb.scene.quaternions import rotation_matrix
from flexmb.scene.schema import Scene
from flexmb.scene.tree import Coordinate, coordinates

DEGREE = math.pi / 180.0
ROUNDING = 1e-15


@of_hinge
def _hinge_axis(hinge: Hinge) -> Hinge:
    if not hasattr(hinge, "axis"):
        raise CaseError(f'hinge "{hinge.name}" has no axis: control "hinge_axis" needs one')
    return replace(hinge, axis=opposite(hinge.axis))


def _reversal_is_a_name(scene: Scene, target: str) -> str:
    """Reversing the sign of a coordinate has no effect if nothing depends on the sign."""
    hinge = next(hinge for hinge in scene.hinges if hinge.name == target)
    coupled = {coupling.hinge for coupling in scene.couplings} | {
        term.hinge for coupling in scene.couplings for term in coupling.terms
    }
    if target in coupled or any(getattr(connector, "hinge", "") == target for connector in scene.connectors):
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


@of_hinge
def _gimbal_order(hinge: Hinge) -> Hinge:
    if not isinstance(hinge, Gimbal):
        raise CaseError(f'hinge "{hinge.name}" is no gimbal: control "gimbal_order" needs one')
    return replace(hinge, sequence=hinge.sequence[::-1])


def _stiffness(scene: Scene, target: str) -> Scene:
    """+1 % stiffness of a flexible body, or of all springs of a hinge."""
    if any(body.name == target for body in scene.bodies):
        return of_body(_stiffer_body)(scene, target)
    return _hinge_constant("stiffness", FACTOR)(scene, target)


def _stiffer_body(body: Body) -> Body:
    match body:
        case BeamBody():
            return scaled_stations(body, ("EA_N", "EIy_Nm2", "EIz_Nm2", "GJ_Nm2"), stiffer)
        case ModalBody() | SidBody():
            return replace(body, stiffness_factor=FACTOR * body.stiffness_factor)
        case RigidBody():
            raise CaseError(f'control "stiffness" changes flexible bodies and hinge springs, not "{body.name}"')
        case _:
            assert_never(body)


def _damping(factor: float) -> SceneChange:
    """Damping of a flexible body, or of all dampers of a hinge or wheel, times a factor."""

    def damped_body(body: Body) -> Body:
        match body:
            case BeamBody():
                ratio = body.modes.damping_ratio
                less = tuple(factor * component for component in ratio) if isinstance(ratio, tuple) else factor * ratio
                return replace(body, modes=replace(body.modes, damping_ratio=less))
            case ModalBody() if body.damping:
                return replace(body, damping=scaled(body.damping, factor))
            case RigidBody() | ModalBody() | SidBody():
                raise CaseError(f'body "{body.name}" has no damping whose size this mutation can change')
            case _:
                assert_never(body)

    def changed(scene: Scene, target: str) -> Scene:
        if any(body.name == target for body in scene.bodies):
            return of_body(damped_body)(scene, target)
        if any(wheel.name == target for wheel in scene.wheels):
            return of_wheel(lambda wheel: multiplied(wheel, ("friction_Nms_rad",), factor))(scene, target)
        return _hinge_constant("damping", factor)(scene, target)

    return changed


def _hinge_constant(stem: str, factor: float) -> SceneChange:
    """Every spring or damper of a hinge, of its scalar coordinates and of the whole (spherical), times a factor."""

    def changed(hinge: Hinge) -> Hinge:
        whole = [key for key in hinge.__struct_fields__ if split_unit(key)[0] == stem]
        return with_each_coordinate(
            multiplied(hinge, whole, factor), lambda each: multiplied(each, (key_of(each, stem),), factor)
        )

    return of_hinge(changed)


@of_coordinates
def _rest(coordinate: Coordinate) -> Coordinate:
    return replace(coordinate, **{key_of(coordinate, "rest"): 0.0})


def _slack(scene: Scene, target: str) -> str:
    hinge = next(hinge for hinge in scene.hinges if hinge.name == target)
    sprung = any(coordinate.spring[0] for _, coordinate in coordinates(hinge))
    return "" if sprung else "it has no spring that could be at rest somewhere"


def _initial(stem: str, factor: float) -> SceneChange:
    """Initial values ("place") or rates of the coordinates that are not prescribed, times a factor."""

    def changed(coordinate: Coordinate) -> Coordinate:
        if coordinate.prescribed is not None:
            return coordinate
        key = coordinate.KEYS.value if stem == "place" else key_of(coordinate, stem)
        return multiplied(coordinate, (key,), factor)

    return of_coordinates(changed)


@of_coordinates
def _initial_unit(coordinate: Coordinate) -> Coordinate:
    if not coordinate.ANGULAR or coordinate.prescribed is not None:
        return coordinate
    return multiplied(coordinate, (coordinate.KEYS.value,), DEGREE)


@of_hinge
def _rotation_sign(hinge: Hinge) -> Hinge:
    if not isinstance(hinge, Free | Spherical):
        return hinge
    return replace(hinge, angular_velocity_rad_s=opposite(hinge.angular_velocity_rad_s))


def _initial_speed_sign(scene: Scene, target: str) -> Scene:
    return _rotation_sign(_initial("rate", OPPOSITE)(scene, target), target)


@of_hinge
def _speed_axes(hinge: Hinge) -> Hinge:
    """Speeds given in outboard axes read as if in inboard axes."""
    if not isinstance(hinge, Free | Spherical):
        raise CaseError(f'the speeds of hinge "{hinge.name}" have no axes: "speed_axes" needs a free or ball joint')
    R = rotation_matrix(hinge.quaternion)
    names = {"angular_velocity_rad_s", "velocity_m_s"} & set(hinge.__struct_fields__)
    return replace(hinge, **{name: tuple(map(float, np.asarray(getattr(hinge, name)) @ R)) for name in names})


@of_hinge
def _attitude(hinge: Hinge) -> Hinge:
    if not isinstance(hinge, Free | Spherical):
        raise CaseError(f'hinge "{hinge.name}" has no quaternion: "initial_attitude" needs a free or ball joint')
    return conjugated(hinge, "quaternion")


def _sprung(scene: Scene) -> list[MutationTarget]:
    return [*bodies(scene), *hinges(scene)]


def _damped(scene: Scene) -> list[MutationTarget]:
    return [*bodies(scene), *hinges(scene), *wheels(scene)]


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
    Mutation(
        "armature_dropped",
        "no armatures",
        "the rotors of drives left out",
        hinges,
        _hinge_constant("armature", DROPPED),
    ),
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
