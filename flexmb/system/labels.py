"""Names and units of the entries of q and u of a system, from its scene."""

from __future__ import annotations

from flexmb.scene.hinges import AngularCoordinate, Free, Hinge, Spherical
from flexmb.scene.schema import PointMass
from flexmb.scene.tree import coordinates
from flexmb.system.tree_system import System

Names = tuple[tuple[str, str], ...]

_QUATERNION = [(f"quaternion.{axis}", "1") for axis in "wxyz"]
_ANGULAR_VELOCITY = [(f"angular_velocity.{axis}", "rad/s") for axis in "xyz"]


def state_names(system: System) -> tuple[Names, Names]:
    """((name, unit) of every entry of q, the same of u)."""
    scene = system.scene
    q, u = [("", "")] * system.nq, [("", "")] * system.nu
    for item in (*scene.hinges, *scene.point_masses):
        in_q, in_u = _hinge_names(item)
        q[system.coordinate(item.name)] = [(f"{item.name}.{name}", unit) for name, unit in in_q]
        u[system.speed(item.name)] = [(f"{item.name}.{name}", unit) for name, unit in in_u]
    for body in scene.bodies:
        place = system.coordinate(f"{body.name}.modes")
        modes = range(place.stop - place.start)
        q[place] = [(f"{body.name}.mode[{n}]", "1") for n in modes]
        u[system.speed(f"{body.name}.modes")] = [(f"{body.name}.mode_rate[{n}]", "1/s") for n in modes]
    for wheel in scene.wheels:
        q[system.coordinate(wheel.name)] = [(f"{wheel.name}.angle", "rad")]
        u[system.speed(wheel.name)] = [(f"{wheel.name}.speed", "rad/s")]
    return tuple(q), tuple(u)


def _hinge_names(item: Hinge | PointMass) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    match item:
        case Spherical():
            return _QUATERNION, _ANGULAR_VELOCITY
        case Free():
            position = [(f"position.{axis}", "m") for axis in "xyz"]
            return position + _QUATERNION, _ANGULAR_VELOCITY + [(f"velocity.{axis}", "m/s") for axis in "xyz"]
    units = [(name, "rad" if isinstance(c, AngularCoordinate) else "m") for name, c in coordinates(item)]
    return units, [(f"{name}.rate", f"{unit}/s") for name, unit in units]
