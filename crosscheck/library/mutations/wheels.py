"""Mutations of wheels."""

from __future__ import annotations

from collections.abc import Callable

import msgspec

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import on_wheel, opposite, scaled, wheels
from crosscheck.library.mutations.mutation import FACTOR, Mutation
from flexmb.scene.schema import Scene, Wheel


def _of_wheel(change: Callable[[Wheel], Wheel]) -> Callable[[Scene, str], Scene]:
    return lambda scene, target: on_wheel(scene, target, change)


def _axis(wheel: Wheel) -> Wheel:
    return msgspec.structs.replace(wheel, axis=opposite(wheel.axis))


def _dropped(wheel: Wheel) -> Wheel:
    if wheel.prescribed_rad is not None:
        raise CaseError(f'the speed of wheel "{wheel.name}" is prescribed: "wheel_momentum" changes an initial one')
    return msgspec.structs.replace(wheel, speed_rad_s=0.0)


def _inertia(wheel: Wheel) -> Wheel:
    return msgspec.structs.replace(wheel, axial_inertia_kg_m2=FACTOR * wheel.axial_inertia_kg_m2)


def _swapped(wheel: Wheel) -> Wheel:
    axial, transverse = wheel.axial_inertia_kg_m2, wheel.transverse_inertia_kg_m2
    return msgspec.structs.replace(wheel, axial_inertia_kg_m2=transverse, transverse_inertia_kg_m2=axial)


def _offset(wheel: Wheel) -> Wheel:
    return msgspec.structs.replace(wheel, offset_m=scaled(wheel.offset_m))


def _reversal_is_a_name(scene: Scene, target: str) -> str:
    """A wheel without speed, motor and prescribed spin turns as it likes: the sign of its angle is a name."""
    wheel = next(wheel for wheel in scene.wheels if wheel.name == target)
    free = wheel.speed_rad_s == 0.0 and wheel.torque_Nm is None and wheel.prescribed_rad is None
    return "without speed, motor and prescribed spin the sign of the wheel's axis only names its angle" if free else ""


MUTATIONS = (
    Mutation("wheel_axis", "opposite spin axis", "a sign", wheels, _of_wheel(_axis), _reversal_is_a_name),
    Mutation(
        "wheel_momentum", "wheel at rest at the start", "the wheel's momentum left out", wheels, _of_wheel(_dropped)
    ),
    Mutation("wheel_inertia", "+1 % axial inertia", "a wrong figure", wheels, _of_wheel(_inertia)),
    Mutation(
        "wheel_inertia_swapped",
        "axial and transverse inertia exchanged",
        "another order of the inertias",
        wheels,
        _of_wheel(_swapped),
    ),
    Mutation("wheel_offset", "+1 % offset of the wheel's centre", "a wrong figure", wheels, _of_wheel(_offset)),
)
