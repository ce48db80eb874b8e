"""Functions of time for prescribed motions and loads.

Those that a prescribed motion accepts are twice continuously differentiable. `value` has the unit of the key for which
the function is given (rad, m, N, Nm). A scene file stores a function as a table with a `kind`, for example
``{kind = "spin_up", rate = 4.0, duration_s = 15.0}``.
"""

from __future__ import annotations

from typing import Annotated

import msgspec

from flexmb.scene.convert import NamedKeys
from flexmb.scene.quantities import Number, Positive, unit

OfKey = Annotated[Number, unit("of the key")]
PerSecond = Annotated[Number, unit("of the key, per s")]


class _Function(
    msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, tag_field="kind", metaclass=NamedKeys
):
    """Base of all functions of time."""


class Constant(_Function, frozen=True, tag="constant", kw_only=True):
    """f(t) = value."""

    value: OfKey


class Ramp(_Function, frozen=True, tag="ramp", kw_only=True):
    """f(t) = value + rate * (t - start_s): constant rate, no acceleration."""

    value: OfKey = 0.0
    rate: PerSecond
    start_s: Number = 0.0


class Sine(_Function, frozen=True, tag="sine", kw_only=True):
    """f(t) = offset + amplitude * sin(angular_frequency * t + phase)."""

    amplitude: OfKey
    angular_frequency_rad_s: Number
    phase_rad: Number = 0.0
    offset: OfKey = 0.0


class SmoothStep(_Function, frozen=True, tag="smooth_step", kw_only=True):
    """Septic blend from `start_value` to `end_value` over [start_s, start_s + duration_s], constant outside.

    s(x) = 35 x^4 - 84 x^5 + 70 x^6 - 20 x^7: rate, acceleration and jerk vanish at both ends.
    """

    start_value: OfKey
    end_value: OfKey
    start_s: Number
    duration_s: Positive


class SpinUp(_Function, frozen=True, tag="spin_up", kw_only=True):
    """Spin-up manoeuvre of Kane, Ryan and Banerjee (1987), as an angle.

    For t <= T: (rate/T) [t^2/2 + (T/2 pi)^2 (cos(2 pi t/T) - 1)], then rate*T/2 + rate*(t - T).
    """

    rate: PerSecond
    duration_s: Positive


class Pulse(_Function, frozen=True, tag="pulse", kw_only=True):
    """`value` for start_s <= t < start_s + duration_s, else 0 (a load only: it is not differentiable)."""

    value: OfKey
    start_s: Number
    duration_s: Positive


class Table(_Function, frozen=True, tag="table", kw_only=True):
    """Quintic spline through samples; defined on [times_s[0], times_s[-1]] only.

    A run must lie within this interval, which is checked before it starts.
    """

    times_s: tuple[Number, ...]
    values: tuple[OfKey, ...]


class ControlSignal(_Function, frozen=True, tag="signal", kw_only=True):
    """`gain` times an output of a controller: feedback as torque of a hinge or wheel, or as force or torque of a load.

    `source` names the controller, or one of its outputs: "attitude[2]". In single evaluations and linear models, which
    have no controllers, the signal is zero.
    """

    source: str
    gain: Annotated[Number, unit("of the key, per one of the signal")] = 1.0


Function = Constant | Ramp | Sine | SmoothStep | SpinUp | Pulse | Table | ControlSignal
