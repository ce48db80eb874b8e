"""What a scene has that a model may give, column by column: the names and units are those of a trajectory's columns."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

from crosscheck.engines.contract import ENERGIES
from flexmb.scene.connectors import AlongHinge, BetweenNodes
from flexmb.scene.hinges import Free, Spherical
from flexmb.scene.schema import Scene
from flexmb.scene.tree import coordinates, rate_name, scalar_paths
from flexmb.scene.values import values_at

Kind = Literal[
    "marker", "acceleration", "load", "total_load", "wheel_load", "connector", "drive", "hinge_force", "energy",
    "momentum", "work",
]  # fmt: skip
XYZ = "xyz"


class ColumnGroup(NamedTuple):
    """Columns that belong together: (name, unit) of each, in the order of the array of the contract that they become.

    A model gives all of them or none. `instead`: the nine columns of a marker's rotation matrix, row by row, which may
    take the place of the four of its quaternion.
    """

    kind: Kind
    name: str
    columns: tuple[tuple[str, str], ...]
    instead: tuple[tuple[str, str], ...] = ()


class StateColumn(NamedTuple):
    """A coordinate or a speed of a scene: its unit and initial value, and whether a function of time prescribes it."""

    unit: str
    start: float
    prescribed: bool = False


def groups(scene: Scene) -> Iterator[ColumnGroup]:
    """All that a model of the scene may give but coordinates and speeds."""
    for marker in scene.markers:
        name = marker.name
        yield ColumnGroup(
            "marker", name,
            (*_vector(f"{name}.position", "m"), *((f"{name}.quaternion.{axis}", "1") for axis in "wxyz"),
             *_vector(f"{name}.angular_velocity", "rad/s"), *_vector(f"{name}.velocity", "m/s")),
            tuple((f"{name}.rotation[{i},{j}]", "1") for i in (1, 2, 3) for j in (1, 2, 3)),
        )  # fmt: skip
        both = _vector(f"{name}.angular_acceleration", "rad/s^2"), _vector(f"{name}.acceleration", "m/s^2")
        yield ColumnGroup("acceleration", name, (*both[0], *both[1]))
    loaded: tuple[tuple[Kind, list[str]], ...] = (
        ("load", [each.name for each in (*scene.hinges, *scene.closures, *scene.couplings, *scene.point_masses)]),
        ("total_load", [each.name for each in scene.total_loads]),
        ("wheel_load", [each.name for each in scene.wheels]),
        ("connector", [each.name for each in scene.connectors if isinstance(each, BetweenNodes)]),
    )
    for kind, names in loaded:
        for name in names:
            yield ColumnGroup(kind, name, (*_vector(f"{name}.torque", "N m"), *_vector(f"{name}.force", "N")))
    for name, units in _driven(scene):
        yield ColumnGroup("drive", name, tuple((f"{name}.drive[{i}]", unit) for i, unit in enumerate(units)))
    for connector in scene.connectors:
        if isinstance(connector, AlongHinge):
            unit = "N m" if connector.ANGULAR else "N"
            yield ColumnGroup("hinge_force", connector.name, ((f"{connector.name}.hinge_force", unit),))
    yield ColumnGroup("energy", "", tuple((f"energy.{kind}", "J") for kind in ENERGIES))  # their sum is a channel, too
    yield ColumnGroup("momentum", "", (*_vector("momentum.angular", "N m s"), *_vector("momentum.linear", "N s")))
    yield ColumnGroup("work", "", (("work", "J"),))


def states(scene: Scene) -> dict[str, StateColumn]:
    """Coordinates and speeds of all hinges, point masses, wheels and modes that the scene gives a value."""
    found: dict[str, StateColumn] = {}
    for name, path in scalar_paths(scene).items():
        if path.startswith("wheels."):
            wheel = values_at(scene, path)[0]
            driven = wheel.prescribed_rad is not None
            unit, value, rate = "rad", wheel.angle_rad, wheel.speed_rad_s
        else:
            item = next(each for each in (*scene.hinges, *scene.point_masses) if name.startswith(f"{each.name}."))
            key = name.removeprefix(f"{item.name}.")
            coordinate = next(each for each in coordinates(item) if each.name == key).coordinate
            driven = coordinate.prescribed is not None
            unit, value, rate = coordinate.UNIT, coordinate.value, coordinate.rate
        found[name] = StateColumn(unit, value, driven)
        found[rate_name(name, path)] = StateColumn(f"{unit}/s", rate, driven)
    for hinge in scene.hinges:
        if isinstance(hinge, Free | Spherical):
            found |= _turning(hinge)
    for state in scene.modal_states:
        found |= {f"{state.body}.mode[{n}]": StateColumn("1", each) for n, each in enumerate(state.coordinates)}
        found |= {f"{state.body}.mode_rate[{n}]": StateColumn("1/s", each) for n, each in enumerate(state.rates)}
    return found


def _turning(hinge: Free | Spherical) -> dict[str, StateColumn]:
    turns = zip(XYZ, hinge.angular_velocity_rad_s, strict=True)
    found = {
        f"{hinge.name}.quaternion.{axis}": StateColumn("1", each)
        for axis, each in zip("wxyz", hinge.quaternion, strict=True)
    }
    found |= {f"{hinge.name}.angular_velocity.{axis}": StateColumn("rad/s", each) for axis, each in turns}
    if isinstance(hinge, Free):
        moves = zip(XYZ, hinge.position_m, hinge.velocity_m_s, strict=True)
        for axis, place, speed in moves:
            found[f"{hinge.name}.position.{axis}"] = StateColumn("m", place)
            found[f"{hinge.name}.velocity.{axis}"] = StateColumn("m/s", speed)
    return found


def _driven(scene: Scene) -> Iterator[tuple[str, list[str]]]:
    """Names of the items with prescribed coordinates, and units of their drive loads."""
    for item in (*scene.hinges, *scene.point_masses):
        prescribed = [each for _, each in coordinates(item) if each.prescribed is not None]
        if prescribed:
            yield item.name, ["N m" if each.ANGULAR else "N" for each in prescribed]
    for wheel in scene.wheels:
        if wheel.prescribed_rad is not None:
            yield wheel.name, ["N m"]


def _vector(name: str, unit: str) -> tuple[tuple[str, str], ...]:
    return tuple((f"{name}.{axis}", unit) for axis in XYZ)
