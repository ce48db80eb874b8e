"""Functions of time evaluated for the peers: value and two derivatives of every kind in `flexmb.scene.functions`.

This is independent of flexmb's compiled evaluation, so that the two check each other.
"""

from __future__ import annotations

from collections.abc import Callable
from math import cos, inf, nan, pi, sin
from typing import NamedTuple, Protocol, assert_never

import numpy as np
from msgspec import Struct

from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Scene


class Profile(NamedTuple):
    """f, df/dt and d2f/dt2 at one time."""

    value: float
    rate: float
    acceleration: float


class Signals(Protocol):
    """What controllers put out now."""

    def value(self, source: str) -> float: ...


def profile(function: Function, signals: Signals | None = None) -> Callable[[float], Profile]:
    """The function as a callable t -> Profile. A table gives NaN outside its interval.

    A signal has the value that it has in `signals` when it is asked for, and no rate; NotImplementedError without them.
    """
    if isinstance(function, ControlSignal) and signals is not None:
        source, gain = function.source, function.gain
        return lambda t: Profile(gain * signals.value(source), nan, nan)
    return _with_last_kept(_evaluated(function))


class CoordinateStart(Protocol):
    """A coordinate with initial values, which a function of time may drive."""

    @property
    def value(self) -> float: ...
    @property
    def rate(self) -> float: ...
    @property
    def prescribed(self) -> Function | None: ...


def initial(coordinate: CoordinateStart) -> tuple[float, float]:
    """Value and rate at t = 0: of the prescribed function where there is one, else the scene's initial values."""
    if coordinate.prescribed is None:
        return coordinate.value, coordinate.rate
    return profile(coordinate.prescribed)(0.0)[:2]


def _with_last_kept(evaluate: Callable[[float], Profile]) -> Callable[[float], Profile]:
    """The same function, evaluated once for successive calls at the same time.

    Engines ask for value and rate separately, in every Newton iteration and every stage of a step: with prescribed
    motions the repeated evaluations took a third of their time.
    """
    last, found = nan, Profile(nan, nan, nan)

    def at(t: float) -> Profile:
        nonlocal last, found
        if t != last:
            found = evaluate(t)
            last = t
        return found

    return at


def _evaluated(function: Function) -> Callable[[float], Profile]:
    match function:
        case Constant(value=value):
            return lambda t: Profile(value, 0.0, 0.0)
        case Ramp(value=value, rate=rate, start_s=start):
            return lambda t: Profile(value + rate * (t - start), rate, 0.0)
        case Sine():
            return _sine(function)
        case SmoothStep():
            return _smooth_step(function)
        case SpinUp(rate=rate, duration_s=duration):
            return _spin_up(rate, duration)
        case Pulse(value=value, start_s=start, duration_s=duration):
            return lambda t: Profile(value if start <= t < start + duration else 0.0, 0.0, 0.0)
        case Table(times_s=times, values=values):
            return _table(times, values)
        case ControlSignal(source=source):
            raise NotImplementedError(f'the signal of controller "{source}" is no function of time')
        case _:
            assert_never(function)


def breaks(function: Function) -> tuple[float, ...]:
    """Times (s) at which the function or a low derivative is not smooth, where an integrator should stop."""
    match function:
        case SmoothStep(start_s=start, duration_s=duration) | Pulse(start_s=start, duration_s=duration):
            return (start, start + duration)
        case SpinUp(duration_s=duration):
            return (duration,)
        case Constant() | Ramp() | Sine() | Table() | ControlSignal():
            return ()
        case _:
            assert_never(function)


def jumps(function: Function) -> tuple[float, ...]:
    """Times (s) after t = 0 at which the value of the function jumps."""
    match function:
        case Pulse(start_s=start, duration_s=duration):
            return tuple(t for t in (start, start + duration) if t > 0.0)
        case Constant() | Ramp() | Sine() | SmoothStep() | SpinUp() | Table() | ControlSignal():
            return ()
        case _:
            assert_never(function)


def breaks_between(functions: list[Function], first: float, last: float) -> list[float]:
    """All break times strictly inside (first, last), sorted, each once."""
    return sorted({t for function in functions for t in breaks(function) if first < t < last})


def scene_functions(scene: Scene) -> list[Function]:
    """Every function of time in the scene: loads, motors, prescribed motions."""
    functions: list[Function] = []

    def visit(item: object) -> None:
        if isinstance(item, Function):
            functions.append(item)
        elif isinstance(item, Struct):
            for key in item.__struct_fields__:
                visit(getattr(item, key))
        elif isinstance(item, tuple):
            for element in item:
                visit(element)

    for part in (scene.hinges, scene.wheels, scene.point_masses, scene.loads, scene.connectors):
        visit(part)
    return functions


def fastest_rate(function: Function, until: float = inf) -> float:
    """Largest |df/dt| (unit/s) over [0, until], for choosing a step; of a table the largest of samples."""
    match function:
        case Constant() | Pulse() | ControlSignal():  # a signal is not known before the run
            return 0.0
        case Ramp(rate=rate) | SpinUp(rate=rate):
            return abs(rate)
        case Sine(amplitude=amplitude, angular_frequency_rad_s=frequency):
            return abs(amplitude * frequency)
        case SmoothStep(start_value=start, end_value=end, duration_s=duration):
            return 35.0 / 16.0 * abs(end - start) / duration  # s'(1/2)
        case Table(times_s=times):
            f = profile(function)
            return max(abs(f(t).rate) for t in np.linspace(times[0], min(times[-1], until), 20 * len(times)))
        case _:
            assert_never(function)


def fastest_change(function: Function, until: float = inf) -> float:
    """Frequency (rad/s) of the sine of the same range that changes as fast as the function, for choosing a step.

    Jumps do not count, since integrators stop there.
    """
    match function:
        case Constant() | Pulse() | ControlSignal() | Ramp():
            return 0.0
        case Sine(angular_frequency_rad_s=frequency):
            return abs(frequency)
        case SmoothStep(start_s=start, duration_s=duration):
            return 2.0 * pi / duration if start < until else 0.0
        case SpinUp(duration_s=duration):
            return 2.0 * pi / duration
        case Table(values=values):
            half = (max(values) - min(values)) / 2.0
            return fastest_rate(function, until) / half if half > 0.0 else 0.0
        case _:
            assert_never(function)


def _sine(function: Sine) -> Callable[[float], Profile]:
    A, w, phase, offset = (
        function.amplitude, function.angular_frequency_rad_s, function.phase_rad, function.offset,
    )  # fmt: skip

    def evaluate(t: float) -> Profile:
        s, c = sin(w * t + phase), cos(w * t + phase)
        return Profile(offset + A * s, A * w * c, -A * w * w * s)

    return evaluate


def _smooth_step(function: SmoothStep) -> Callable[[float], Profile]:
    start, T = function.start_s, function.duration_s
    first, height = function.start_value, function.end_value - function.start_value

    def evaluate(t: float) -> Profile:
        x = min(max((t - start) / T, 0.0), 1.0)
        return Profile(
            first + height * x**4 * (35.0 - 84.0 * x + 70.0 * x**2 - 20.0 * x**3),
            height / T * 140.0 * x**3 * (1.0 - x) ** 3,
            height / T**2 * 420.0 * x**2 * (1.0 - x) ** 2 * (1.0 - 2.0 * x),
        )

    return evaluate


def _spin_up(rate: float, T: float) -> Callable[[float], Profile]:
    def evaluate(t: float) -> Profile:
        if t >= T:
            return Profile(rate * (t - T / 2.0), rate, 0.0)
        x = 2.0 * pi * t / T
        return Profile(
            rate / T * (t * t / 2.0 + (T / (2.0 * pi)) ** 2 * (cos(x) - 1.0)),
            rate / T * (t - T / (2.0 * pi) * sin(x)),
            rate / T * (1.0 - cos(x)),
        )

    return evaluate


def _table(times: tuple[float, ...], values: tuple[float, ...]) -> Callable[[float], Profile]:
    from scipy.interpolate import make_interp_spline  # takes 0.2 s to import, and few scenes have a table

    spline = make_interp_spline(times, values, k=5)
    derivatives = (spline, spline.derivative(1), spline.derivative(2))
    for derivative in derivatives:
        derivative.extrapolate = False
    return lambda t: Profile(*(float(derivative(t)) for derivative in derivatives))
