"""A scene without its initial values: what is left is the model, which may begin anywhere."""

from __future__ import annotations

from typing import Any

import msgspec

from flexmb.scene.hinges import Free, Spherical
from flexmb.scene.schema import PointMass, Scene
from flexmb.scene.tree import coordinates, with_coordinates


def without_start(scene: Scene) -> Scene:
    """The scene with the default initial coordinates and speeds of hinges, point masses, wheels and modes."""
    return msgspec.structs.replace(
        scene,
        hinges=tuple(_at_default(hinge) for hinge in scene.hinges),
        point_masses=tuple(_at_default(mass) for mass in scene.point_masses),
        wheels=tuple(_reset(wheel, "angle_rad", "speed_rad_s") for wheel in scene.wheels),
        modal_states=(),
    )


def _at_default(item: Any) -> Any:
    match item:
        case Free():
            return _reset(item, "position_m", "quaternion", "angular_velocity_rad_s", "velocity_m_s", "given")
        case Spherical():
            return _reset(item, "quaternion", "angular_velocity_rad_s", "given")
        case PointMass() if not item.coordinates:
            return item
        case _:
            every = [_reset(each, each.KEYS.value, each.KEYS.rate, "given") for _, each in coordinates(item)]
            return with_coordinates(item, every) if every else item


def _reset(item: Any, *keys: str) -> Any:
    """A structure with the default values of some of its keys."""
    defaults = {field.name: field.default for field in msgspec.structs.fields(type(item)) if field.name in keys}
    return msgspec.structs.replace(item, **defaults)
