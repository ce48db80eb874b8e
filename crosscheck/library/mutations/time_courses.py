"""Mutations of functions of time: of motors, actuators, prescribed motion, loads, and profiles to follow."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import TypeVar, assert_never

from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import (
    of_connector,
    of_coordinates,
    of_load,
    of_sensor,
    of_wheel,
)
from crosscheck.library.mutations.mutation import FACTOR, HUNDREDTH, OPPOSITE, Mutation, MutationTarget
from crosscheck.library.time_functions import delayed, scaled
from flexmb.scene.connectors import Connector, HingeSpring, SpringDamper, actuator
from flexmb.scene.control import ProfileSensor
from flexmb.scene.freedoms import Coordinate
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Load, Scene, Wheel
from flexmb.scene.tree import coordinates

Change = Callable[[Function], Function]
Moved = TypeVar("Moved", bound=Coordinate | Wheel)
PHASE_RAD = 0.01


def _motors(scene: Scene) -> Iterator[MutationTarget]:
    """Hinges and wheels with a motor, and springs with an actuator."""
    for hinge in scene.hinges:
        if any(coordinate.effort is not None for _, coordinate in coordinates(hinge)):
            yield MutationTarget(hinge.name, "motor of a hinge")
    yield from (MutationTarget(wheel.name, "motor of a wheel") for wheel in scene.wheels if wheel.torque_Nm is not None)
    yield from (MutationTarget(connector.name, "actuator of a connector") for connector, _ in _actuators(scene))


def _driven(scene: Scene) -> Iterator[MutationTarget]:
    """Everything with a function of time; one kind for each kind of function."""
    for hinge in scene.hinges:
        for _, coordinate in coordinates(hinge):
            for what, function in (("motor", coordinate.effort), ("drive", coordinate.prescribed)):
                if function is not None:
                    yield MutationTarget(hinge.name, f"{what}, {_kind(function)}")
    for wheel in scene.wheels:
        for function in (wheel.torque_Nm, wheel.prescribed_rad):
            if function is not None:
                yield MutationTarget(wheel.name, f"wheel, {_kind(function)}")
    yield from (MutationTarget(load.name, f"load, {_kind(load.function)}") for load in scene.loads)
    yield from (MutationTarget(connector.name, f"actuator, {_kind(force)}") for connector, force in _actuators(scene))
    for sensor in scene.sensors:
        if isinstance(sensor, ProfileSensor):
            yield MutationTarget(sensor.name, f"profile, {_kind(sensor.function)}")


def _actuators(scene: Scene) -> Iterator[tuple[SpringDamper | HingeSpring, Function]]:
    """Springs with a function of time, and that."""
    for connector in scene.connectors:
        if isinstance(connector, SpringDamper | HingeSpring):
            function = actuator(connector)
            if function is not None:
                yield connector, function


def _on_item(scene: Scene, target: str, change: Change, motion: Change | None = None) -> Scene:
    """What is called `target`, with its prescribed motions changed by `motion` and all other functions by `change`."""

    def with_functions(item: Moved) -> Moved:
        keys = item.KEYS
        changes = {keys.effort: change, keys.prescribed: motion}
        return replace(item, **{key: _changed(getattr(item, key), by) for key, by in changes.items()})

    def with_actuator(spring: Connector) -> Connector:
        assert isinstance(spring, SpringDamper | HingeSpring)  # it has an actuator
        return replace(spring, **{spring.ACTUATOR: _changed(actuator(spring), change)})

    def with_function(item: Load | ProfileSensor) -> Load | ProfileSensor:
        return replace(item, function=change(item.function))

    if any(hinge.name == target for hinge in scene.hinges):
        return of_coordinates(with_functions)(scene, target)
    if any(wheel.name == target for wheel in scene.wheels):
        return of_wheel(with_functions)(scene, target)
    if any(load.name == target for load in scene.loads):
        return of_load(with_function)(scene, target)
    if any(connector.name == target for connector, _ in _actuators(scene)):
        return of_connector(with_actuator)(scene, target)
    if any(isinstance(sensor, ProfileSensor) and sensor.name == target for sensor in scene.sensors):
        return of_sensor(with_function)(scene, target)
    raise CaseError(f'no hinge, wheel, load, actuator or profile is called "{target}"')


def _changed(function: Function | None, change: Change | None) -> Function | None:
    return function if function is None or change is None else change(function)


def _motor_sign(scene: Scene, target: str) -> Scene:
    return _on_item(scene, target, lambda function: scaled(function, OPPOSITE))


def _size(scene: Scene, target: str) -> Scene:
    return _on_item(scene, target, lambda function: scaled(function, FACTOR), _farther)


def _late(scene: Scene, target: str) -> Scene:
    return _on_item(scene, target, _a_little_late, _a_little_late)


def _farther(motion: Function) -> Function:
    """A prescribed motion that goes farther from where it begins, which the initial state fits."""
    match motion:
        case Ramp():
            start = motion.value - motion.rate * motion.start_s
            return replace(motion, value=start, rate=FACTOR * motion.rate, start_s=0.0)
        case Sine():
            start = motion.amplitude * math.sin(motion.phase_rad)
            offset = motion.offset + (1.0 - FACTOR) * start
            return replace(motion, amplitude=FACTOR * motion.amplitude, offset=offset)
        case SmoothStep():
            end = motion.start_value + FACTOR * (motion.end_value - motion.start_value)
            return replace(motion, end_value=end)
        case Constant() | SpinUp() | Pulse() | Table() | ControlSignal():
            return scaled(motion, FACTOR)
        case _:
            assert_never(motion)


def _a_little_late(function: Function) -> Function:
    """By a hundredth of the function's own time; of a ramp, which has none, by a hundredth of a second."""
    match function:
        case SmoothStep() | Pulse():
            return delayed(function, HUNDREDTH * function.duration_s)
        case Sine():
            frequency = function.angular_frequency_rad_s
            return delayed(function, PHASE_RAD / frequency) if frequency != 0.0 else function
        case Ramp():
            return delayed(function, HUNDREDTH)
        case SpinUp():
            return replace(function, duration_s=FACTOR * function.duration_s)
        case Table():
            raise CaseError("a table of values ends where it ends: it cannot come late")
        case Constant() | ControlSignal():  # these have no time of their own
            return function
        case _:
            assert_never(function)


def _kind(function: Function) -> str:
    return str(function.__struct_config__.tag)


MUTATIONS = (
    Mutation(
        "motor_sign",
        "opposite torque or force of a motor or actuator",
        "motor on the wrong one of two bodies",
        _motors,
        _motor_sign,
    ),
    Mutation("function_size", "+1 % of a function of time", "a wrong figure", _driven, _size),
    Mutation(
        "function_phase",
        "a function of time late by a hundredth of its own time (a spin-up takes 1 % longer)",
        "another phase, or another zero of the clock",
        _driven,
        _late,
    ),
)
