"""Checks of feedback: existing signals, matching sizes, valid sampling instants, and no algebraic loops."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, NamedTuple, assert_never

from flexmb.scene import schema as s
from flexmb.scene.check.profiles import MOTIONS
from flexmb.scene.check.walk import entries, holding, suspicious
from flexmb.scene.problems import Defect, Place, closest
from flexmb.scene.tree import coordinates, scalar_paths
from flexmb.scene.user_code import refusal

REFERENCE = re.compile(r"(?P<name>[^\[\]]+)(?:\[(?P<number>\d+)\])?")
AT_ONCE = ("acceleration", "angular_acceleration", "specific_force")
ADDRESS = re.compile(r"[\w.]+:\w[\w.]*")


class Named(NamedTuple):
    """A parsed signal reference: a sensor or controller, and the index of one of its numbers, None for all."""

    name: str
    number: int | None


def named(reference: str) -> Named | None:
    """A reference such as "gyro" or "gyro[2]" in its parts; None if it is neither."""
    match = REFERENCE.fullmatch(reference)
    return None if match is None else Named(match["name"], None if match["number"] is None else int(match["number"]))


def sensor_width(scene: s.Scene, sensor: s.Sensor) -> int | None:
    """Number of values of a sensor; None if it is known only after compilation, or the name does not exist."""
    match sensor:
        case s.CoordinateSensor(of=of, quantity=quantity):
            return _coordinates(scene, of, quantity == "rate")
        case s.MarkerSensor(quantity=quantity):
            return 4 if quantity == "orientation" else 3
        case s.LoadSensor():
            return 6
        case s.ProfileSensor() | s.DistanceSensor():
            return 2
        case s.DriveSensor() | s.TimeSensor():
            return 1
        case _:
            assert_never(sensor)


def _coordinates(scene: s.Scene, of: str, rates: bool) -> int | None:
    for hinge in scene.hinges:
        if hinge.name == of:
            # the freedoms of a gimbal whose sequence does not fit its rotations are undefined; `hinges` reports that
            return len(coordinates(hinge)) or sum(freedom.sizes[rates] for freedom in hinge.freedoms)
    for mass in scene.point_masses:
        if mass.name == of:
            return len(coordinates(mass))
    return 1 if any(wheel.name == of for wheel in scene.wheels) else None


def depends_at_once(sensor: s.Sensor) -> bool:
    """Whether the signal depends directly on forces: accelerations and loads."""
    match sensor:
        case s.MarkerSensor():
            return sensor.quantity in AT_ONCE
        case s.LoadSensor() | s.DriveSensor():
            return True
        case s.CoordinateSensor() | s.DistanceSensor() | s.TimeSensor() | s.ProfileSensor():
            return False
        case _:
            assert_never(sensor)


def output_width(controller: s.Controller, inputs: int | None) -> int | None:
    """Number of outputs of a controller with this number of inputs."""
    match controller:
        case s.StateSpace(C=C, D=D):
            return len(C) or len(D)
        case s.Pid():
            return 1
        case s.UserLaw(outputs=outputs):
            return outputs
        case s.GainTable():
            return None if inputs is None else max(1, inputs - 1)
        case s.Saturation():
            return inputs
        case _:
            assert_never(controller)


def widths_of(scene: s.Scene) -> dict[str, int | None]:
    """Number of values of every sensor and controller; None if it is known only after compilation."""
    widths = {sensor.name: sensor_width(scene, sensor) for sensor in scene.sensors}
    for controller in scene.controllers:
        each = [_width(reference, widths) for reference in controller.inputs]
        inputs = None if None in each else sum(width for width in each if width is not None)
        widths[controller.name] = output_width(controller, inputs)
    return widths


def one_number(place: Place, reference: str, widths: dict[str, int | None]) -> Iterator[Defect]:
    """A reference is known, and to one number."""
    yield from _reference(place, reference, widths, set())
    names = named(reference)
    width = None if names is None or names.number is not None else widths.get(names.name)
    if names is not None and width is not None and width != 1:
        yield Defect(str(place), f'"{names.name}" has {width} numbers', f'say which: "{names.name}[0]"')


def control(scene: s.Scene) -> Iterator[Defect]:
    """All problems of sensors, controllers and signals."""
    yield from _sensors(scene)
    widths: dict[str, int | None] = {sensor.name: sensor_width(scene, sensor) for sensor in scene.sensors}
    immediate = {sensor.name for sensor in scene.sensors if depends_at_once(sensor)}
    later = {controller.name for controller in scene.controllers}
    for place, controller in entries(scene, "controllers"):
        inputs: int | None = 0
        for i, reference in enumerate(controller.inputs):
            spot = place.key("inputs", i)
            yield from _reference(spot, reference, widths, later)
            width = _width(reference, widths)
            inputs = None if inputs is None or width is None else inputs + width
        yield from _instants(place, controller)
        yield from _sizes(place, controller, inputs)
        yield from _at_once(place, controller, immediate, widths)
        widths[controller.name] = output_width(controller, inputs)
    yield from _signals(scene, {controller.name: widths[controller.name] for controller in scene.controllers})


def _sensors(scene: s.Scene) -> Iterator[Defect]:
    moving = [item.name for key in ("hinges", "wheels", "point_masses") for item in getattr(scene, key)]
    moving += [f"{body.name}.modes" for body in scene.bodies if isinstance(body, s.BeamBody | s.ModalBody)]
    markers = [marker.name for marker in scene.markers]
    loaded = [item.name for item in (*scene.hinges, *scene.constraints)]
    known: dict[Any, tuple[tuple[str, ...], str, list[str]]] = {
        s.CoordinateSensor: (("of",), "hinge, wheel, point mass or modes", moving),
        s.MarkerSensor: (("marker",), "marker", markers),
        s.DistanceSensor: (("marker_a", "marker_b"), "marker", markers),
        s.LoadSensor: (("hinge",), "hinge, closure or coupling", loaded),
        s.DriveSensor: (("coordinate",), "scalar coordinate", list(scalar_paths(scene))),
    }
    for place, sensor in entries(scene, "sensors"):
        if type(sensor) in known:
            keys, what, names = known[type(sensor)]
            for key in keys:
                if getattr(sensor, key) not in names:
                    remedy = closest(getattr(sensor, key), names)
                    yield Defect(str(place.key(key)), f'there is no {what} "{getattr(sensor, key)}"', remedy)
        if isinstance(sensor, s.ProfileSensor) and isinstance(sensor.function, s.ControlSignal):
            remedy = f'let the controller take "{sensor.function.source}" itself'
            yield Defect(str(place.key("function")), "a signal is no function of time", remedy)


def _width(reference: str, widths: dict[str, int | None]) -> int | None:
    names = named(reference)
    if names is None or names.name not in widths:
        return None
    return widths[names.name] if names.number is None else 1


def _reference(place: Place, reference: str, widths: dict[str, int | None], later: set[str]) -> Iterator[Defect]:
    """A referenced signal exists, is computed before, and has a number of this index."""
    names = named(reference)
    if names is None:
        yield Defect(str(place), f'"{reference}" is no signal', 'write "name", or "name[0]" for one of its numbers')
    elif names.name not in widths:
        what = f'there is no sensor or controller "{names.name}"'
        if names.name in later:
            what, remedy = f'controller "{names.name}" is listed later', "list a controller before those that read it"
        else:
            remedy = closest(names.name, widths)
        yield Defect(str(place), what, remedy)
    else:
        width = widths[names.name]
        if names.number is not None and width is not None and names.number >= width:
            remedy = f"its numbers are 0 to {width - 1}"
            yield Defect(str(place), f'"{names.name}" has no number {names.number}', remedy)


def _instants(place: Place, controller: s.Controller) -> Iterator[Defect]:
    for key in ("offset_s", "delay_s"):
        if getattr(controller, key) and controller.period_s is None:
            remedy = "give its period_s too: a continuous controller has no instants, and no delay"
            yield Defect(str(place.key(key)), f'controller "{controller.name}" is continuous', remedy)


def _sizes(place: Place, controller: s.Controller, inputs: int | None) -> Iterator[Defect]:
    match controller:
        case s.StateSpace():
            yield from _matrices(place, controller, inputs)
        case s.Pid():
            yield from _pid(place, controller, inputs)
        case s.Saturation(lower=lower, upper=upper):
            if not lower <= upper:
                yield Defect(str(place.key("lower")), f"it is above upper, {upper:g}", "exchange the two")
        case s.GainTable(points=points, values=values):
            if len(points) != len(values) or not points:
                what = f"there are {len(points)} points and {len(values)} values"
                yield Defect(str(place.key("values")), what, "give one value for each point, and one point at least")
            if any(b <= a for a, b in zip(points, points[1:], strict=False)):
                yield Defect(str(place.key("points")), "the points do not increase", "sort them, each once")
        case s.UserLaw(function=function):
            if not ADDRESS.fullmatch(function):
                remedy = 'write "package.module:function"'
                yield Defect(str(place.key("function")), f'"{function}" is no name of a function', remedy)
            elif forbidden := refusal(function):
                yield Defect(str(place.key("function")), *forbidden)
        case _:
            assert_never(controller)
    if inputs == 0 and not isinstance(controller, s.UserLaw | s.StateSpace):
        yield Defect(str(place.key("inputs")), "it has no input", "name a sensor or controller")


def _matrices(place: Place, controller: s.StateSpace, inputs: int | None) -> Iterator[Defect]:
    n, p = len(controller.A), output_width(controller, inputs)
    if not p:
        yield Defect(str(place), "it has no output", "give C, D or both")
    columns = {"A": n, "B": inputs, "C": n, "D": inputs}
    rows = {"A": n, "B": n, "C": p if n else 0, "D": len(controller.D) and p}
    for key in columns:
        matrix = getattr(controller, key)
        if len(matrix) != rows[key] and not (key == "B" and inputs == 0 and not matrix):
            yield Defect(str(place.key(key)), f"it has {len(matrix)} rows", f"give {rows[key]}: A is {n} x {n}")
        for i, row in enumerate(matrix):
            if columns[key] is not None and len(row) != columns[key]:
                what = f"it has {len(row)} columns"
                yield Defect(str(place.key(key, i)), what, f"give {columns[key]}: one for each of what it multiplies")
                break
    if controller.initial and len(controller.initial) != n:
        what = f"it has {len(controller.initial)} numbers"
        yield Defect(str(place.key("initial")), what, f"give one for each of the {n} states, or leave it out")


def _pid(place: Place, pid: s.Pid, inputs: int | None) -> Iterator[Defect]:
    if inputs is not None and inputs not in (0, 1, 2):
        what = f"its inputs are {inputs} numbers"
        yield Defect(str(place.key("inputs")), what, "give the measured one, and if it varies the setpoint")
    if pid.kd and not pid.filter_s and pid.period_s is None:
        remedy = "give filter_s, a small part of the fastest period of interest; or feed a rate to a state_space"
        yield Defect(str(place.key("filter_s")), "a continuous derivative needs a filter", remedy)
    if pid.lower is not None and pid.upper is not None and not pid.lower <= pid.upper:
        yield Defect(str(place.key("lower")), f"it is above upper, {pid.upper:g}", "exchange the two")


def _at_once(
    place: Place, controller: s.Controller, immediate: set[str], widths: dict[str, int | None]
) -> Iterator[Defect]:
    """No algebraic loops: a continuous output must not depend directly on a signal that it changes directly."""
    if controller.period_s is not None:
        return
    column = 0
    for i, reference in enumerate(controller.inputs):
        found, width = named(reference), _width(reference, widths)
        if found is not None and found.name in immediate and not _delays(controller, column, width):
            what = f'an algebraic loop: "{reference}" changes at once with the output of "{controller.name}"'
            remedy = "give the controller a period_s, or put a state_space without D in front of it, which filters"
            yield Defect(str(place.key("inputs", i)), what, remedy)
        column = column + width if width is not None else column


def _delays(controller: s.Controller, column: int, width: int | None) -> bool:
    """Whether this input and the next ones affect the outputs only through states (no direct feedthrough)."""
    if not isinstance(controller, s.StateSpace) or width is None:
        return False
    return not any(any(row[column : column + width]) for row in controller.D)


def _signals(scene: s.Scene, widths: dict[str, int | None]) -> Iterator[Defect]:
    """Signals name one output of a controller, and drive loads: no motion can follow what jumps."""
    for place, key, value in suspicious(scene, holding(s.ControlSignal)):
        if not isinstance(value, s.ControlSignal) or key == "function" and place.path.startswith("$.sensors"):
            continue
        yield from _reference(place.key("source"), value.source, widths, set())
        names = named(value.source)
        if names is not None and names.number is None and (widths.get(names.name) or 1) > 1:
            what = f'controller "{names.name}" has {widths[names.name]} outputs'
            yield Defect(str(place.key("source")), what, f'say which: "{names.name}[0]"')
        if key in MOTIONS:
            remedy = "give it as torque_Nm or force_N"
            yield Defect(str(place), "a controller cannot prescribe a motion", remedy)
