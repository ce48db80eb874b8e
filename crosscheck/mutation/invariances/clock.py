"""A shift of the clock of functions of time.

For any engine, as runs begin at t = 0 here: only what can be written on another clock all the same, a sine by whole
turns of its phase, a ramp by its start. Runs that begin at another time are `later`.
"""

from __future__ import annotations

import math
from typing import assert_never

import msgspec

from crosscheck.library.time_functions import in_functions
from crosscheck.mutation.invariances.counterpart import (
    Counterpart,
    Invariance,
    NotApplicable,
    without_events,
    without_feedback,
)
from crosscheck.mutation.invariances.linearised import relation
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Scene

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
