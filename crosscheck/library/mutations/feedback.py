"""Mutations of feedback: of controllers, of their sample times, and of sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from msgspec.structs import replace

from crosscheck.library.case import CaseError
from crosscheck.library.mutations.edits import multiplied, of_controller, of_sensor
from crosscheck.library.mutations.mutation import FACTOR, HUNDREDTH, OPPOSITE, Mutation, MutationTarget, SceneChange
from flexmb.scene.check.control import named, sensor_width
from flexmb.scene.control import (
    Controller,
    GainTable,
    MarkerSensor,
    Pid,
    Saturation,
    Sensor,
    StateSpace,
    UserLaw,
)
from flexmb.scene.schema import Scene

Keys = dict[type[Controller], tuple[str, ...]]
GAINS: Keys = {Pid: ("kp", "ki", "kd"), StateSpace: ("C", "D"), GainTable: ("values",)}
NUMBERS: Keys = {**GAINS, UserLaw: ("parameters",)}  # which parameters of a user's law are gains is unknown
DYNAMICS: Keys = {Pid: ("filter_s", "tracking_s"), StateSpace: ("A",)}
LIMITS: Keys = {Pid: ("lower", "upper"), Saturation: ("lower", "upper")}
SETPOINT: Keys = {Pid: ("setpoint",)}
CONJUGATE = (1.0, OPPOSITE, OPPOSITE, OPPOSITE)


def controllers(scene: Scene) -> Iterator[MutationTarget]:
    for controller in scene.controllers:
        kind = "continuous" if controller.period_s is None else "sampled"
        yield MutationTarget(controller.name, f"{kind} {controller.__struct_config__.tag}")


def sensors(scene: Scene) -> Iterator[MutationTarget]:
    for sensor in scene.sensors:
        what = getattr(sensor, "quantity", "")
        yield MutationTarget(sensor.name, f"{sensor.__struct_config__.tag} sensor {what}".strip())


def _scaled(keys: Keys, factor: float) -> SceneChange:
    """The numbers of a controller under these keys of its kind, times a factor."""

    def changed(controller: Controller) -> Controller:
        return multiplied(controller, keys.get(type(controller), ()), factor)

    return of_controller(changed)


def _in_time(change: Callable[[Controller, float], dict[str, float]]) -> SceneChange:
    """A change of a sampled controller's timing by a function of its period (s)."""

    def changed(controller: Controller) -> Controller:
        if controller.period_s is None:
            raise CaseError(f'controller "{controller.name}" is continuous: it acts at all times')
        return replace(controller, **change(controller, controller.period_s))

    return of_controller(changed)


def _sensor(scene: Scene, target: str) -> tuple[Sensor, int]:
    """The sensor and its number of outputs."""
    sensor = next((sensor for sensor in scene.sensors if sensor.name == target), None)
    width = None if sensor is None else sensor_width(scene, sensor)
    if sensor is None or width is None:
        raise CaseError(f'"{target}" is no sensor whose numbers can be counted in scene "{scene.name}"')
    return sensor, width


def _reading(scene: Scene, target: str, instead: Callable[[int | None], tuple[str, ...]]) -> tuple[Controller, ...]:
    """The controllers with the signals of a sensor replaced: of one of its outputs, or (None) of all."""

    def signals(reference: str) -> tuple[str, ...]:
        signals = named(reference)
        return instead(signals.number) if signals is not None and signals.name == target else (reference,)

    return tuple(
        replace(controller, inputs=tuple(name for reference in controller.inputs for name in signals(reference)))
        for controller in scene.controllers
    )


@of_sensor
def _sensor_frame(sensor: Sensor) -> Sensor:
    if not isinstance(sensor, MarkerSensor) or sensor.quantity == "orientation":
        raise CaseError(f'what sensor "{sensor.name}" measures is in no axes')
    return replace(sensor, frame="marker" if sensor.frame == "world" else "world")


def _sensor_sign(scene: Scene, target: str) -> Scene:
    """Insert a state space without states behind the sensor, with the timing of the first controller that reads it."""
    sensor, width = _sensor(scene, target)
    orientation = isinstance(sensor, MarkerSensor) and sensor.quantity == "orientation"
    signs = CONJUGATE if orientation else (OPPOSITE,) * width
    reading = [
        controller
        for controller in scene.controllers
        if any(_names(reference, target) for reference in controller.inputs)
    ]
    if not reading:
        raise CaseError(f'no controller reads sensor "{target}"')
    reverse = StateSpace(
        name=f"{target} reversed",
        inputs=(target,),
        D=tuple(tuple(sign if i == j else 0.0 for j in range(width)) for i, sign in enumerate(signs)),
        period_s=reading[0].period_s,
        offset_s=reading[0].offset_s,
    )

    def reversed_signals(number: int | None) -> tuple[str, ...]:
        return (reverse.name if number is None else f"{reverse.name}[{number}]",)

    return replace(scene, controllers=(reverse, *_reading(scene, target, reversed_signals)))


def _sensor_component(scene: Scene, target: str) -> Scene:
    _, width = _sensor(scene, target)
    if width < 2:
        raise CaseError(f'sensor "{target}" has one number, which nothing can be mistaken for')
    order = (1, 0, *range(2, width))

    def exchanged(number: int | None) -> tuple[str, ...]:
        return tuple(f"{target}[{i}]" for i in (order if number is None else order[number : number + 1]))

    return replace(scene, controllers=_reading(scene, target, exchanged))


def _names(reference: str, sensor: str) -> bool:
    names = named(reference)
    return names is not None and names.name == sensor


MUTATIONS = (
    Mutation(
        "controller_gain",
        "+1 % gains of a controller; of a user's law all its parameters",
        "a wrong figure",
        controllers,
        _scaled(NUMBERS, FACTOR),
    ),
    Mutation("controller_sign", "opposite gains", "feedback for its negative", controllers, _scaled(GAINS, OPPOSITE)),
    Mutation(
        "controller_dynamics",
        "+1 % of a controller's A, or of its time constants",
        "a wrong figure",
        controllers,
        _scaled(DYNAMICS, FACTOR),
    ),
    Mutation("controller_limit", "limits 1 % wider", "a wrong figure", controllers, _scaled(LIMITS, FACTOR)),
    Mutation("controller_setpoint", "+1 % setpoint", "a wrong figure", controllers, _scaled(SETPOINT, FACTOR)),
    Mutation(
        "controller_period",
        "+1 % period",
        "a wrong figure",
        controllers,
        _in_time(lambda _, period: {"period_s": FACTOR * period}),
    ),
    Mutation(
        "controller_offset",
        "samples late by a hundredth of the period",
        "another zero of the controller's clock",
        controllers,
        _in_time(lambda each, period: {"offset_s": each.offset_s + HUNDREDTH * period}),
    ),
    Mutation(
        "controller_delay",
        "no delay",
        "outputs that change when they are computed",
        controllers,
        _in_time(lambda _, period: {"delay_s": 0.0}),
    ),
    Mutation(
        "sensor_frame",
        "World axes for the marker's, or the other way",
        "body axes for World axes",
        sensors,
        _sensor_frame,
    ),
    Mutation(
        "sensor_sign",
        "opposite sign of all that a sensor shows; of an orientation its conjugate",
        "a sensor that is mounted the other way",
        sensors,
        _sensor_sign,
    ),
    Mutation(
        "sensor_component",
        "first two numbers of a sensor exchanged",
        "another order of the components",
        sensors,
        _sensor_component,
    ),
)
