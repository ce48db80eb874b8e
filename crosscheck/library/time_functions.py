"""Changes of functions of time: scaled values, a scaled or shifted clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, assert_never

import msgspec

from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.keys import struct_keys

# The keys of every kind of function that are values, times or frequencies.
VALUES: dict[type, tuple[str, ...]] = {
    Constant: ("value",),
    Ramp: ("value", "rate"),
    Sine: ("amplitude", "offset"),
    SmoothStep: ("start_value", "end_value"),
    SpinUp: ("rate",),
    Pulse: ("value",),
    Table: ("values",),
    ControlSignal: ("gain",),
}
TIMES: dict[type, tuple[str, ...]] = {
    Constant: (),
    Ramp: ("start_s",),
    Sine: (),
    SmoothStep: ("start_s", "duration_s"),
    SpinUp: ("duration_s",),
    Pulse: ("start_s", "duration_s"),
    Table: ("times_s",),
    ControlSignal: (),
}
FREQUENCIES: dict[type, tuple[str, ...]] = {
    Constant: (),
    Ramp: ("rate",),
    Sine: ("angular_frequency_rad_s",),
    SmoothStep: (),
    SpinUp: ("rate",),
    Pulse: (),
    Table: (),
    ControlSignal: (),
}


def scaled(function: Function, factor: float) -> Function:
    """The function factor * f(t)."""
    return _multiplied(function, VALUES, factor)


def slowed(function: Function, factor: float) -> Function:
    """The function f(t / factor)."""
    return _multiplied(_multiplied(function, TIMES, factor), FREQUENCIES, 1.0 / factor)


def delayed(function: Function, delay: float) -> Function:
    """The function f(t - delay), `delay` in seconds; a spin-up, which always begins at zero, is unchanged."""
    match function:
        case Ramp() | SmoothStep() | Pulse():
            return msgspec.structs.replace(function, start_s=function.start_s + delay)
        case Sine():
            phase = function.phase_rad - function.angular_frequency_rad_s * delay
            return msgspec.structs.replace(function, phase_rad=phase)
        case Table():
            return msgspec.structs.replace(function, times_s=tuple(time + delay for time in function.times_s))
        case Constant() | SpinUp() | ControlSignal():
            return function
        case _:
            assert_never(function)


def _multiplied(function: Function, keys: dict[type, tuple[str, ...]], factor: float) -> Function:
    return msgspec.structs.replace(
        function, **{key: _times(getattr(function, key), factor) for key in keys[type(function)]}
    )


def _times(value: float | tuple[float, ...], factor: float) -> float | tuple[float, ...]:
    return tuple(factor * component for component in value) if isinstance(value, tuple) else factor * value


def in_functions(item: Any, change: Callable[[Function], Function]) -> Any:
    if isinstance(item, Function):
        return change(item)
    if isinstance(item, tuple):
        return tuple(in_functions(element, change) for element in item) if item and _holds_structs(item) else item
    if not isinstance(item, msgspec.Struct):
        return item
    return msgspec.structs.replace(
        item, **{key: in_functions(getattr(item, key), change) for key in struct_keys(type(item))}
    )


def _holds_structs(items: tuple) -> bool:
    return isinstance(items[0], msgspec.Struct)
