"""Sensor signals in a linear model: their exact derivatives, from those of the observed quantities."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple, assert_never

import numpy as np
from scipy.spatial.transform import Rotation

from flexmb.control.wiring import driven_speed
from flexmb.linear.observed import moving, observed
from flexmb.linear.variations import Equations, Variations
from flexmb.scene.control import (
    CoordinateSensor,
    DistanceSensor,
    DriveSensor,
    LoadSensor,
    MarkerSensor,
    ProfileSensor,
    Sensor,
    TimeSensor,
)
from flexmb.system.kinks import NotDifferentiableError
from flexmb.system.system import System
from flexmb.tables.state import DynamicsError
from flexmb.typing import Flags, Real

_PLACES = {
    "position": slice(0, 3), "angular_velocity": slice(12, 15), "velocity": slice(15, 18),
    "angular_acceleration": slice(18, 21), "acceleration": slice(21, 24), "specific_force": slice(21, 24),
}  # fmt: skip
_UNITS = {
    "position": "m", "orientation": "1", "angular_velocity": "rad/s", "velocity": "m/s",
    "angular_acceleration": "rad/s^2", "acceleration": "m/s^2", "specific_force": "m/s^2",
}  # fmt: skip


class ChangedRow(NamedTuple):
    """A row of observed quantities, its change (E,k) along k directions, and that of [q, u] (nq+nu,k)."""

    value: Real
    change: Real
    of_state: Real


def sensed(system: System, at: ChangedRow) -> Real:
    """(S,k) change of all sensor signals, in the order of the scene."""
    rows = [np.zeros((0, at.change.shape[1])), *(_change(system, sensor, at) for sensor in system.scene.sensors)]
    return np.concatenate(rows)


def readable(laws: Real, change: Real) -> Real:
    """The change (S,k) of signals that laws read by (m,S), without those of loads that the motion leaves open.

    `NotDifferentiableError` if a law reads one of these.
    """
    is_open: Flags = np.any(~np.isfinite(change), axis=1)
    if np.any(laws[:, is_open]):
        raise NotDifferentiableError(
            "a controller reads a load that the motion does not determine, because closures are redundant: let it "
            "read another one"
        )
    return np.where(is_open[:, None], 0.0, change)


def sensor_names(system: System) -> Iterator[tuple[str, str]]:
    """Names ("gyro[0]", or "angle" for a sensor with one number) and units."""
    for sensor in system.scene.sensors:
        units = _units(system, sensor)
        for n, unit in enumerate(units):
            yield (sensor.name if len(units) == 1 else f"{sensor.name}[{n}]"), unit


def _units(system: System, sensor: Sensor) -> list[str]:
    match sensor:
        case CoordinateSensor(of=of, quantity=quantity):
            place = system.coordinate(of) if quantity == "value" else system.speed(of)
            return [unit for _, unit in system.state_names[0 if quantity == "value" else 1][place]]
        case MarkerSensor(quantity=quantity):
            return [_UNITS[quantity]] * (4 if quantity == "orientation" else 3)
        case DistanceSensor():
            return ["m", "m/s"]
        case LoadSensor():
            return ["N m"] * 3 + ["N"] * 3
        case DriveSensor(coordinate=coordinate):
            names = dict(system.state_names[0])
            return ["N" if names[coordinate] == "m" else "N m"]
        case ProfileSensor():
            return ["1", "1/s"]
        case TimeSensor():
            return ["s"]
        case _:
            assert_never(sensor)


def _change(system: System, sensor: Sensor, at: ChangedRow) -> Real:
    """(width,k) change of one sensor's signals."""
    names, k = system.observation.names, at.change.shape[1]
    match sensor:
        case CoordinateSensor(of=of, quantity="value"):
            return at.of_state[system.coordinate(of)]
        case CoordinateSensor(of=of):
            return at.of_state[system.nq :][system.speed(of)]
        case MarkerSensor(marker=marker):
            row, change = _part(system, at, "markers", list(names.markers).index(marker))
            return _of_marker(sensor, row, change, system.constants.gravity)
        case DistanceSensor(marker_a=one, marker_b=other):
            ends = (_part(system, at, "markers", list(names.markers).index(marker)) for marker in (one, other))
            return _of_distance(sensor, *ends)
        case LoadSensor(hinge=hinge):
            part, group = ("loads", names.hinges) if hinge in names.hinges else ("closures", names.closures)
            return _part(system, at, part, list(group).index(hinge))[1]
        case DriveSensor(coordinate=coordinate):
            speed = driven_speed(system, coordinate)
            return np.zeros((1, k)) if speed < 0 else _part(system, at, "drives", speed)[1].reshape(1, k)
        case TimeSensor():
            return np.zeros((1, k))
        case ProfileSensor():
            return np.zeros((2, k))
        case _:
            assert_never(sensor)


def _part(system: System, at: ChangedRow, name: str, i: int) -> tuple[Real, Real]:
    """Value and change of item i of a part of the row."""
    place, shape = system.observation.columns[name]
    return at.value[place].reshape(shape)[i], at.change[place].reshape(*shape, at.change.shape[1])[i]


def _of_marker(sensor: MarkerSensor, value: Real, change: Real, gravity: Real) -> Real:
    """Change of a marker sensor, from the marker's row (24,) and its change (24,k)."""
    R, dR = value[3:12].reshape(3, 3), change[3:12].reshape(3, 3, -1)
    if sensor.quantity == "orientation":
        turn = np.einsum("ijk,lj->ilk", dR, R)  # R' = turn R
        return _of_quaternion(R, np.stack([turn[2, 1], turn[0, 2], turn[1, 0]]))
    place = _PLACES[sensor.quantity]
    if sensor.frame == "world":
        return change[place]
    x = value[place] - gravity if sensor.quantity == "specific_force" else value[place]
    return np.asarray(R.T @ change[place] + np.einsum("ijk,i->jk", dR, x))


def _of_quaternion(R: Real, turn: Real) -> Real:
    """(4,k) change of the quaternion of R (nonnegative scalar part) by small rotations (3,k), World axes."""
    q = Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True)
    return 0.5 * np.vstack([-q[1:] @ turn, q[0] * turn + np.cross(turn.T, q[1:]).T])


def _of_distance(sensor: DistanceSensor, a: tuple[Real, Real], b: tuple[Real, Real]) -> Real:
    """(2,k) change of a distance and its rate; DynamicsError where both markers coincide."""
    value, change = b[0] - a[0], b[1] - a[1]
    position, velocity = _PLACES["position"], _PLACES["velocity"]
    length = float(np.linalg.norm(value[position]))
    if length == 0.0:
        raise DynamicsError(
            f'sensor "{sensor.name}": its markers are at one place, where a distance has no derivative: move one'
        )
    along = value[position] / length
    longer = along @ change[position]
    rate = along @ value[velocity]
    faster = along @ change[velocity] + (value[velocity] @ change[position] - rate * longer) / length
    return np.vstack([longer, faster])


class OfSensors(NamedTuple):
    """Names and units of all sensor signals (S), and their derivatives: by the state [xi; du] (S,2f) of a linear model,
    by generalised forces along the n free speeds (S,n)."""

    names: list[tuple[str, str]]
    by_state: Real
    by_force: Real


def of_sensors(equations: Equations, at: Variations) -> OfSensors:
    """At the state of these variations; DynamicsError where there are no accelerations."""
    system, found = equations.system, observed(equations, at)
    still = np.zeros((system.nq + system.nu, found.by_force.shape[1]))
    by_state = sensed(system, ChangedRow(found.value, found.by_state, moving(equations, at)))
    by_force = sensed(system, ChangedRow(found.value, found.by_force, still))
    return OfSensors([*sensor_names(system)], by_state, by_force)
