"""A run that begins at another time, with everything that depends on the time shifted equally.

Functions of time, the instants of sampled controllers and events on time are shifted; what does not depend on the time
must not notice. Laws of users are told the time: those of flexmb, which alone a case may name, make no use of it.
"""

from __future__ import annotations

import math
from typing import TypeVar, assert_never

import msgspec
from msgspec.structs import replace

from crosscheck.library.time_functions import delayed, in_functions
from crosscheck.mutation.invariances.counterpart import (
    Counterpart,
    Invariance,
    NotApplicable,
    without_events,
    without_feedback,
)
from crosscheck.mutation.invariances.linearised import relation
from flexmb.scene.check.control import named
from flexmb.scene.control import Controller, TimeSensor
from flexmb.scene.events import Change, SceneEvent
from flexmb.scene.freedoms import Coordinate
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Scene, Wheel
from flexmb.scene.tree import Item, coordinates, watchable, with_coordinates

START_S = 2.375  # no multiple of any period
Moved = TypeVar("Moved", bound=Coordinate | Wheel)
OF_THE_CLOCK = ("start_s", "phase_rad", "offset_s")


def _later(scene: Scene) -> Counterpart:
    _refuse_what_cannot_be_shifted(scene)
    watched = watchable(scene)

    def event_later(event: SceneEvent) -> SceneEvent:
        if watched[event.watch] != "time":
            return event
        return replace(event, level=event.level + START_S)

    def controller_later(controller: Controller) -> Controller:
        if controller.period_s is None:
            return controller
        return replace(controller, offset_s=controller.offset_s + START_S)

    shifted: Scene = in_functions(scene, _shifted)
    other = replace(
        shifted,
        hinges=tuple(map(_coordinates_as_their_profiles_begin, shifted.hinges)),
        point_masses=tuple(map(_coordinates_as_their_profiles_begin, shifted.point_masses)),
        wheels=tuple(map(_as_its_profile_begins, shifted.wheels)),
        events=tuple(map(event_later, shifted.events)),
        controllers=tuple(map(controller_later, shifted.controllers)),
    )
    linear = relation(scene, other)
    return Counterpart(other, lambda times, channels: channels, starts_s=START_S, linear=linear)


def _coordinates_as_their_profiles_begin(item: Item) -> Item:
    """Without initial values of what is prescribed: a scene may repeat there what its profile is at t = 0."""
    return with_coordinates(item, [_as_its_profile_begins(coordinate) for _, coordinate in coordinates(item)])


def _as_its_profile_begins(item: Moved) -> Moved:
    keys = item.KEYS
    return item if getattr(item, keys.prescribed) is None else replace(item, **{keys.value: 0.0, keys.rate: 0.0})


def _shifted(function: Function) -> Function:
    if isinstance(function, SpinUp):
        raise NotApplicable('a "spin_up" begins at t = 0 and cannot be shifted')
    if isinstance(function, Table):
        raise NotApplicable('a "table" that is shifted does not cover t = 0, at which engines look at a scene')
    return delayed(function, START_S)


def _refuse_what_cannot_be_shifted(scene: Scene) -> None:
    """A controller that reads the time itself, and an event that changes a number which belongs to the clock."""
    clocks = {sensor.name for sensor in scene.sensors if isinstance(sensor, TimeSensor)}
    for controller in scene.controllers:
        for reference in controller.inputs:
            names = named(reference)
            if names is not None and names.name in clocks:
                raise NotApplicable(f'controller "{controller.name}" reads the time by sensor "{names.name}"')
    for event in scene.events:
        for action in event.actions:
            if isinstance(action, Change) and action.path.rpartition(".")[2] in OF_THE_CLOCK:
                raise NotApplicable(f'event "{event.name}" changes "{action.path}", which belongs to the clock')


LATER = Invariance("later", "begun at another time, with all that depends on the time shifted as far", _later)


# A shift of the clock of functions of time. For any engine, as runs begin at t = 0 here: only what can be written on
# another clock all the same, a sine by whole turns of its phase, a ramp by its start. Runs that begin at another time
# are `later`.

SHIFT_S = 2.0
WHOLE_TURNS = 1


def _rewritten(scene: Scene) -> Counterpart:
    without_feedback(scene)
    without_events(scene)
    functions: list[Function] = []

    def on_another_clock(function: Function) -> Function:
        functions.append(function)
        match function:
            case Ramp():
                start = function.start_s + SHIFT_S
                return msgspec.structs.replace(function, start_s=start, value=function.value + function.rate * SHIFT_S)
            case Sine():
                return msgspec.structs.replace(function, phase_rad=function.phase_rad + WHOLE_TURNS * 2.0 * math.pi)
            case Constant():
                return function
            case SmoothStep() | SpinUp() | Pulse() | Table() | ControlSignal():
                kind = function.__struct_config__.tag
                raise NotApplicable(f'a "{kind}" cannot be shifted without a start time of the run')
            case _:
                assert_never(function)

    other = in_functions(scene, on_another_clock)
    if other == scene:
        raise NotApplicable("nothing depends on the clock")
    return Counterpart(other, lambda times, channels: channels, linear=relation(scene, other))


CLOCK = Invariance("clock", "functions of time written on another clock", _rewritten)
