"""Mutations of wheels."""

from __future__ import annotations

from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import more, of_wheel, opposite, wheels
from crosscheck.library.mutations.mutation import Mutation
from flexmb.scene.schema import Scene, Wheel


@of_wheel
def _axis(wheel: Wheel) -> Wheel:
    return replace(wheel, axis=opposite(wheel.axis))


@of_wheel
def _dropped(wheel: Wheel) -> Wheel:
    if wheel.prescribed_rad is not None:
        raise CaseError(f'the speed of wheel "{wheel.name}" is prescribed: "wheel_momentum" changes an initial one')
    return replace(wheel, speed_rad_s=0.0)


@of_wheel
def _swapped(wheel: Wheel) -> Wheel:
    axial, transverse = wheel.axial_inertia_kg_m2, wheel.transverse_inertia_kg_m2
    return replace(wheel, axial_inertia_kg_m2=transverse, transverse_inertia_kg_m2=axial)


def _reversal_is_a_name(scene: Scene, target: str) -> str:
    """A wheel without speed, motor and prescribed spin turns as it likes: the sign of its angle is a name."""
    wheel = next(wheel for wheel in scene.wheels if wheel.name == target)
    free = wheel.speed_rad_s == 0.0 and wheel.torque_Nm is None and wheel.prescribed_rad is None
    return "without speed, motor and prescribed spin the sign of the wheel's axis only names its angle" if free else ""


MUTATIONS = (
    Mutation("wheel_axis", "opposite spin axis", "a sign", wheels, _axis, _reversal_is_a_name),
    Mutation("wheel_momentum", "wheel at rest at the start", "the wheel's momentum left out", wheels, _dropped),
    Mutation("wheel_inertia", "+1 % axial inertia", "a wrong figure", wheels, more(of_wheel, "axial_inertia_kg_m2")),
    Mutation(
        "wheel_inertia_swapped",
        "axial and transverse inertia exchanged",
        "another order of the inertias",
        wheels,
        _swapped,
    ),
    Mutation("wheel_offset", "+1 % offset of the wheel's centre", "a wrong figure", wheels, more(of_wheel, "offset_m")),
)
