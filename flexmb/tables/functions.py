"""Functions of time in kernels: value, rate and acceleration of every kind of flexmb.scene.functions."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import assert_never

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.jit.lanes import every, select
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.spatial.scalar import cos, sin
from flexmb.tables.arrays import FUNCTION
from flexmb.tables.pieces import piece_at
from flexmb.typing import Real, Record

_CONSTANT, _RAMP, _SINE, _SMOOTH_STEP, _SPIN_UP, _PULSE, _TABLE = range(7)


def pack(functions: Sequence[Function]) -> tuple[Record, Real]:
    """FUNCTION records (F,) and the table (T,8) of spline pieces, as `flexmb.tables.pieces` has them."""
    out = np.zeros(len(functions), FUNCTION)
    pieces: list[tuple[float, ...]] = []
    for row, function in zip(out, functions, strict=True):
        row["start"] = len(pieces)
        match function:
            case Constant(value=value):
                row["kind"], row["data"] = _CONSTANT, (value, 0.0, 0.0, 0.0)
            case ControlSignal():  # a run with feedback writes the output of its controllers to `data`
                row["kind"] = _CONSTANT
            case Ramp(value=value, rate=rate, start_s=begin):
                row["kind"], row["data"] = _RAMP, (value, rate, begin, 0.0)
            case Sine(amplitude=a, angular_frequency_rad_s=w, phase_rad=phase, offset=offset):
                row["kind"], row["data"] = _SINE, (a, w, phase, offset)
            case SmoothStep(start_value=a, end_value=b, start_s=begin, duration_s=duration):
                row["kind"], row["data"] = _SMOOTH_STEP, (a, b, begin, duration)
            case SpinUp(rate=rate, duration_s=duration):
                row["kind"], row["data"] = _SPIN_UP, (rate, duration, 0.0, 0.0)
            case Pulse(value=value, start_s=begin, duration_s=duration):
                row["kind"], row["data"] = _PULSE, (value, begin, begin + duration, 0.0)
            case Table(times_s=times, values=values):
                # imported here because it takes longer than all other imports of a run without tables
                from scipy.interpolate import PPoly, make_interp_spline

                row["kind"] = _TABLE
                spline = PPoly.from_spline(make_interp_spline(times, values, k=5))
                ends = zip(spline.x[:-1], spline.x[1:], strict=True)
                # the intervals between repeated end knots have no length and are left out
                pieces += [(left, 0.0, *spline.c[:, i]) for i, (left, right) in enumerate(ends) if right > left]
            case _:
                assert_never(function)
        row["stop"] = len(pieces)
    return out, np.array(pieces, dtype=float).reshape(-1, 8)


def any_varies(functions: Record) -> bool:
    """Whether the values of any of these functions change with time; those that controllers write are held."""
    return bool(np.any(functions["kind"] != _CONSTANT))


@helper
def _smooth_step(a, b, begin, duration, t):
    x = (t - begin) / duration
    before, after = x.real <= 0.0, x.real >= 1.0
    if every(before):
        return a, 0.0, 0.0
    if every(after):
        return b, 0.0, 0.0
    x2 = x * x
    x3 = x2 * x
    value = x3 * x * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))
    rate = x3 * (140.0 + x * (-420.0 + x * (420.0 - 140.0 * x)))
    acceleration = x2 * (420.0 + x * (-1680.0 + x * (2100.0 - 840.0 * x)))
    d = b - a
    resting = before | after
    return (
        select(before, a, select(after, b, a + d * value)),
        select(resting, 0.0, d * rate / duration),
        select(resting, 0.0, d * acceleration / (duration * duration)),
    )


@helper
def _spin_up(rate, duration, t):
    after = t.real >= duration.real
    if every(after):
        return rate * (t - 0.5 * duration), rate, 0.0
    k = 2.0 * pi / duration
    c = cos(k * t)
    value = rate / duration * (0.5 * t * t + (c - 1.0) / (k * k))
    return (
        select(after, rate * (t - 0.5 * duration), value),
        select(after, rate, rate / duration * (t - sin(k * t) / k)),
        select(after, 0.0, rate / duration * (1.0 - c)),
    )


@helper
def _spline(table, first, last, t):
    piece = piece_at(t, table, first, last)
    x = t - piece[0]
    value = 0.0
    rate = 0.0
    half = 0.0
    for n in range(2, 8):  # Horner for the polynomial, its derivative and half its second derivative
        half = half * x + rate
        rate = rate * x + value
        value = value * x + piece[n]
    return value, rate, 2.0 * half


@helper
def evaluate(kind, data, first, last, table, t):
    """(value, rate, acceleration) at time t of one function: `data` its row, table[first:last] its spline pieces."""
    if kind == _SINE:
        phase = data[1] * t + data[2]
        s = data[0] * sin(phase)
        return data[3] + s, data[0] * data[1] * cos(phase), -data[1] * data[1] * s
    if kind == _RAMP:
        return data[0] + data[1] * (t - data[2]), data[1], 0.0
    if kind == _SMOOTH_STEP:
        return _smooth_step(data[0], data[1], data[2], data[3], t)
    if kind == _SPIN_UP:
        return _spin_up(data[0], data[1], t)
    if kind == _PULSE:
        return select((data[1].real <= t.real) & (t.real < data[2].real), data[0], 0.0), 0.0, 0.0
    if kind == _TABLE:
        return _spline(table, first, last, t)
    return data[0], 0.0, 0.0
