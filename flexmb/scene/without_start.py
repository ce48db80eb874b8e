"""A scene without its initial values: what is left is the model, which may begin anywhere."""

from __future__ import annotations

from typing import TypeVar, assert_never

import msgspec

from flexmb.scene.hinges import Free, Hinge, Spherical
from flexmb.scene.schema import PointMass, Scene
from flexmb.scene.tree import coordinates, with_coordinates

Item = TypeVar("Item", bound=Hinge | PointMass)
Struct = TypeVar("Struct", bound=msgspec.Struct)


def without_start(scene: Scene) -> Scene:
    """The scene with the default initial coordinates and speeds of hinges, point masses, wheels and modes."""
    return msgspec.structs.replace(
        scene,
        hinges=tuple(_at_default(hinge) for hinge in scene.hinges),
        point_masses=tuple(_still(mass) for mass in scene.point_masses),
        wheels=tuple(_reset(wheel, "angle_rad", "speed_rad_s") for wheel in scene.wheels),
        modal_states=(),
    )


def _at_default(hinge: Hinge) -> Hinge:
    if not isinstance(hinge, Spherical | Free):
        return _still(hinge)
    match hinge:
        case Spherical():
            return _reset(hinge, "quaternion", "angular_velocity_rad_s", "given")
        case Free():
            return _reset(hinge, "position_m", "quaternion", "angular_velocity_rad_s", "velocity_m_s", "given")
        case _:
            assert_never(hinge)


def _still(item: Item) -> Item:
    """A hinge or a point mass with the default initial values of the scalar coordinates that it lists."""
    if isinstance(item, PointMass) and not item.coordinates:
        return item
    every = [_reset(each, each.KEYS.value, each.KEYS.rate, "given") for _, each in coordinates(item)]
    return with_coordinates(item, every) if every else item


def _reset(item: Struct, *keys: str) -> Struct:
    """A structure with the default values of some of its keys."""
    defaults = {field.name: field.default for field in msgspec.structs.fields(type(item)) if field.name in keys}
    return msgspec.structs.replace(item, **defaults)
