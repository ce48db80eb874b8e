"""From a scene to the tables of its closed loop: indices of signals, and connections of inputs and outputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any, NamedTuple, assert_never

import numpy as np

from flexmb.control import laws
from flexmb.control import tables as a
from flexmb.control.user import compiled_address, found
from flexmb.jit.foreign import is_foreign
from flexmb.scene.check.control import named, output_width
from flexmb.scene.control import (
    Controller,
    CoordinateSensor,
    DistanceSensor,
    DriveSensor,
    GainTable,
    LoadSensor,
    MarkerSensor,
    Pid,
    ProfileSensor,
    Saturation,
    Sensor,
    StateSpace,
    TimeSensor,
    UserLaw,
)
from flexmb.scene.convert import ROOT, label
from flexmb.scene.functions import Function
from flexmb.scene.loaded import called
from flexmb.scene.schema import Scene
from flexmb.scene.tree import rate_name, scalar_paths
from flexmb.system.system import System
from flexmb.tables.functions import pack
from flexmb.typing import Index, Real, Record

_QUANTITIES = {
    "position": a.POSITION, "orientation": a.ORIENTATION, "velocity": a.VELOCITY,
    "angular_velocity": a.ANGULAR_VELOCITY, "acceleration": a.ACCELERATION,
    "angular_acceleration": a.ANGULAR_ACCELERATION, "specific_force": a.SPECIFIC_FORCE,
}  # fmt: skip
_LAWS = {StateSpace: a.LINEAR, Pid: a.PID, Saturation: a.CLAMP, GainTable: a.LOOKUP}


class Wiring(NamedTuple):
    """The parts of a `Loop` that are known before a run. names: signals by sensor and controller; laws: the plain
    Python functions by controller."""

    sensor: Record
    controller: Record
    wire: Index
    number: Real
    drive: Record
    course: Record
    piece: Real
    initial: Real  # of `Loop.state`
    names: dict[str, slice]
    continuous: Real  # (X,) those of continuous controllers
    reads_at_once: bool
    laws: dict[int, Callable[..., None]]


def wired(system: System) -> Wiring:
    """The wiring of a system whose scene was checked.

    SceneError for a user function that cannot be loaded, ValueError for references that can be checked only with
    compiled bodies.
    """
    scene = system.scene
    sensor, course, piece, names = _sensors(system)
    at_once = [sensor["kind"][i] >= a.AT_ONCE for i in range(len(sensor))]
    immediate = {n for row in sensor[at_once] for n in range(row["signal"], row["signal"] + row["width"])}
    record, wire = np.zeros(len(scene.controllers), a.CONTROLLER), list[int]()
    number, initial = list[float](), list[float]()
    follows, continuous, outputs = False, list[float](), 0
    plain: dict[int, Callable[..., None]] = {}
    for i, (row, controller) in enumerate(zip(record, scene.controllers, strict=True)):
        inputs = [n for reference in controller.inputs for n in numbers_of(names, reference)]
        width = output_width(controller, len(inputs)) or 0
        first = max((place.stop for place in names.values()), default=0)
        names[controller.name] = slice(first, first + width)
        states, numbers = _states(controller), _numbers(controller, len(inputs))
        row["sampled"] = controller.period_s is not None
        row["signal"], row["x"] = first, len(continuous)
        row["input"], row["inputs"], row["state"], row["states"] = len(wire), len(inputs), len(initial), len(states)
        row["output"], row["outputs"], row["number"], row["numbers"] = outputs, width, len(number), len(numbers)
        if isinstance(controller, UserLaw):
            place = ROOT.key("controllers", i).named(label("controllers", controller)).key("function")
            law = found(controller.function, called(scene), place)
            if is_foreign(law):
                row["law"], row["function"] = a.COMPILED, compiled_address(law, called(scene), place)
            else:
                row["law"], plain[i] = a.CALLED, law
        else:
            row["law"] = _LAWS[type(controller)]
        if controller.period_s is None:
            continuous += states
            follows |= not immediate.isdisjoint(inputs)
        wire += inputs
        number += numbers
        initial += states
        outputs += width
    drive = np.zeros(len(system.signals), a.DRIVE)
    for row, (function, signal) in zip(drive, system.signals.items(), strict=True):
        row["function"], row["signal"], row["gain"] = function, numbers_of(names, signal.source)[0], signal.gain
    return Wiring(
        sensor, record, np.array(wire, np.int64), np.array(number, float), drive, course, piece,
        np.array(initial, float), names, np.array(continuous, float), follows, plain,
    )  # fmt: skip


def _sensors(system: System) -> tuple[Record, Record, Real, dict[str, slice]]:
    """SENSOR records, functions of profiles with their spline pieces, and signals by name."""
    sensors = system.scene.sensors
    record, names, first = np.zeros(len(sensors), a.SENSOR), dict[str, slice](), 0
    profiles = _profiles(system.scene)
    for row, sensor in zip(record, sensors, strict=True):
        row["kind"], row["place"], row["width"], row["axes"] = _sensor(system, sensor)
        if isinstance(sensor, ProfileSensor):
            row["place"] = profiles.index(sensor.function)
        row["signal"] = first
        names[sensor.name] = slice(first, first + int(row["width"]))
        first += int(row["width"])
    return record, *pack(profiles), names


def profile_tables(scene: Scene) -> tuple[Record, Real]:
    """FUNCTION records of the functions that sensors read, and their spline pieces."""
    return pack(_profiles(scene))


def _profiles(scene: Scene) -> list[Function]:
    return [sensor.function for sensor in scene.sensors if isinstance(sensor, ProfileSensor)]


def _sensor(system: System, sensor: Sensor) -> tuple[int, int, int, int]:
    """Kind, place, width and axes."""
    observed = system.observation.names
    match sensor:
        case CoordinateSensor(of=of, quantity="value"):
            place = system.coordinate(of)
            return a.COORDINATE, place.start, place.stop - place.start, a.WORLD
        case CoordinateSensor(of=of):
            place = system.speed(of)
            return a.RATE, system.nq + place.start, place.stop - place.start, a.WORLD
        case MarkerSensor(marker=marker, quantity=quantity, frame=frame):
            axes = a.WORLD if frame == "world" else a.OWN
            width = 4 if quantity == "orientation" else 3
            return _QUANTITIES[quantity], list(observed.markers).index(marker), width, axes
        case DistanceSensor(marker_a=one, marker_b=other):
            return a.DISTANCE, list(observed.markers).index(one), 2, list(observed.markers).index(other)
        case LoadSensor(hinge=hinge):
            return a.LOAD, [*observed.hinges, *observed.closures].index(hinge), 6, a.WORLD
        case DriveSensor(coordinate=coordinate):
            return a.DRIVE_LOAD, driven_speed(system, coordinate), 1, a.WORLD
        case TimeSensor():
            return a.TIME, 0, 1, a.WORLD
        case ProfileSensor():
            return a.PROFILE, 0, 2, a.WORLD
        case _:
            assert_never(sensor)


def driven_speed(system: System, coordinate: str) -> int:
    """The index of a scalar coordinate's prescribed speed, -1 where it is free."""
    rate = rate_name(coordinate, scalar_paths(system.scene)[coordinate])
    number = [name for name, _ in system.state_names[1]].index(rate)
    return number if system.constants.speed["prescribed"][number] >= 0 else -1


def numbers_of(names: dict[str, slice], reference: str) -> list[int]:
    """Indices of the signals that a reference names; ValueError for an index that does not exist."""
    at = named(reference)
    assert at is not None  # the scene was checked
    every = list(range(names[at.name].start, names[at.name].stop))
    if at.number is None:
        return every
    if at.number >= len(every):
        raise ValueError(f'signal "{reference}": "{at.name}" has {len(every)} numbers, 0 to {len(every) - 1}')
    return [every[at.number]]


def law_numbers(controllers: Sequence[Controller], inputs: Sequence[int]) -> tuple[Real, Real]:
    """The parameters of all controllers with so many inputs each, and the initial values of their states."""
    numbers = [
        value for controller, count in zip(controllers, inputs, strict=True) for value in _numbers(controller, count)
    ]
    return np.array(numbers), np.array([value for controller in controllers for value in _states(controller)])


def _states(controller: Controller) -> list[float]:
    """Initial values of the states."""
    match controller:
        case StateSpace(A=A, initial=initial):
            return list(initial) or [0.0] * len(A)
        case UserLaw(initial=initial):
            return list(initial)
        case Pid(period_s=period):
            return [0.0] * (laws.FILTERED + 1 if period is None else laws.BEGUN + 1)
        case Saturation() | GainTable():
            return []
        case _:
            assert_never(controller)


def _numbers(controller: Controller, inputs: int) -> list[float]:
    """Parameters in the layout of the laws; ValueError if matrices do not fit inputs known only after compilation."""
    match controller:
        case StateSpace():
            return _matrices(controller, inputs).ravel().tolist()
        case Pid() as pid:
            numbers = [0.0] * laws.PID_NUMBERS
            numbers[laws.KP], numbers[laws.KI], numbers[laws.KD], numbers[laws.FILTER] = (
                pid.kp,
                pid.ki,
                pid.kd,
                pid.filter_s,
            )
            numbers[laws.LOWER] = -np.inf if pid.lower is None else pid.lower
            numbers[laws.UPPER] = np.inf if pid.upper is None else pid.upper
            numbers[laws.TRACKING], numbers[laws.SETPOINT] = _tracking(pid), pid.setpoint
            numbers[laws.PERIOD] = pid.period_s or 0.0
            return numbers
        case Saturation(lower=lower, upper=upper):
            return [lower, upper]
        case GainTable(points=points, values=values):
            return [*points, *values]
        case UserLaw(parameters=parameters):
            return list(parameters)
        case _:
            assert_never(controller)


def _tracking(pid: Pid) -> float:
    """Time constant of the anti-windup tracking, at least the period of a sampled controller."""
    if pid.tracking_s is not None:
        return pid.tracking_s
    if not pid.ki:
        return np.inf
    return max(abs(pid.kp / pid.ki), pid.period_s or 0.0) or 1.0


def _matrices(controller: StateSpace, inputs: int) -> Any:
    """[A B; C D]."""
    n, p = len(controller.A), len(controller.C) or len(controller.D)
    block = np.zeros((n + p, n + inputs))
    places = {"A": (0, 0, n), "B": (0, n, inputs), "C": (n, 0, n), "D": (n, n, inputs)}
    for key, (row, column, width) in places.items():
        matrix = getattr(controller, key)
        if any(len(row_of_matrix) != width for row_of_matrix in matrix):
            raise ValueError(f'controller "{controller.name}": {key} has {len(matrix[0])} columns, {width} are needed')
        for i, row_of_matrix in enumerate(matrix):
            block[row + i, column : column + width] = row_of_matrix
    return block


def widest(record: Record) -> int:
    """The largest number of outputs of a controller."""
    return max(chain([1], record["outputs"].tolist()))
