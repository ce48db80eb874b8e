"""Functions of time: tables in order, defined over the run, smooth where they prescribe a motion that starts there."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, sin
from typing import assert_never, get_args

from flexmb.scene.bodies import SceneStruct
from flexmb.scene.check.walk import finite, holding, suspicious
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.problems import Defect, Place
from flexmb.scene.rounding import ROUNDING
from flexmb.scene.schema import Scene

SAMPLES = 6  # a quintic spline needs degree + 1
# Initial values printed to ten digits agree with the profile this well, relative to the larger of it and one unit.
PRINTED = 1e-9
MOTIONS = ("prescribed_rad", "prescribed_m")
SMOOTH = "use smooth_step, spin_up, sine, ramp, constant, or a table"


def functions(scene: Scene, t_end: float | None, t_start: float = 0.0) -> Iterator[Defect]:
    """Problems of every function in the scene; tables must cover t_start (s), and with `t_end` (s) reach that far."""
    for place, key, value in suspicious(scene, holding(*get_args(Function))):
        if isinstance(value, Function) and finite(value):
            if isinstance(value, Table):
                yield from _table(place, value)
                yield from _covers(place, value, t_end, t_start)
            if isinstance(value, Pulse) and key in MOTIONS:
                yield Defect(str(place), "a pulse jumps: no body can follow it", SMOOTH)


def start_of(function: Function) -> tuple[float, float] | None:
    """Value and rate at t = 0; None for a function that is not well-formed, jumps or is a controller's."""
    match function:
        case Constant(value=value):
            return value, 0.0
        case Ramp(value=value, rate=rate, start_s=start):
            return value - rate * start, rate
        case Sine(amplitude=a, angular_frequency_rad_s=w, phase_rad=phase, offset=offset):
            return offset + a * sin(phase), a * w * cos(phase)
        case SmoothStep(duration_s=duration):
            return _smooth_step_start(function) if duration > 0.0 else None
        case SpinUp(duration_s=duration):
            return (0.0, 0.0) if duration > 0.0 else None
        case Table():
            return _table_start(function)
        case Pulse() | ControlSignal():
            return None
        case _:
            assert_never(function)


def _table_start(table: Table) -> tuple[float, float] | None:
    if any((*_table(ROOT, table), *_covers(ROOT, table, None, 0.0))):
        return None
    # imported here, because it takes longer than all other imports of a scene without tables
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(table.times_s, table.values, k=5)
    return float(spline(0.0)), float(spline(0.0, 1))


def initial_motion(place: Place, item: SceneStruct, keys: tuple[str, str], function: Function) -> Iterator[Defect]:
    """A prescribed coordinate starts where its profile does: initial values are left out, or agree with it.

    `keys` are the schema keys of the initial value and rate of `item`.
    """
    start = start_of(function)
    if start is None:
        return
    for key, profile in zip(keys, start, strict=True):
        given = getattr(item, key)
        size = max(1.0, abs(profile))
        if abs(given) > ROUNDING * size and abs(given - profile) > PRINTED * size:  # what is zero is not given
            what = f"starts at {given:g}, but its prescribed motion at {profile:g}"
            yield Defect(str(place.key(key)), what, f"leave {key} out: the profile says where the motion starts")


def _table(place: Place, table: Table) -> Iterator[Defect]:
    count = len(table.times_s)
    if len(table.values) != count:
        what = f"the table has {count} times but {len(table.values)} values"
        yield Defect(str(place.key("values")), what, "give one value for each time")
    if count < SAMPLES:
        remedy = f"a quintic spline needs {SAMPLES} samples at least"
        yield Defect(str(place.key("times_s")), f"the table has only {count} samples", remedy)
    for i in range(count - 1):
        if table.times_s[i + 1] <= table.times_s[i]:
            what = f"the table's times do not increase: {table.times_s[i]:g} s, then {table.times_s[i + 1]:g} s"
            yield Defect(str(place.key("times_s", i + 1)), what, "sort the samples and drop repeated times")
            return


def _covers(place: Place, table: Table, t_end: float | None, t_start: float) -> Iterator[Defect]:
    if not table.times_s:
        return
    first, last = table.times_s[0], table.times_s[-1]
    needed = t_start if t_end is None else t_end
    slack = ROUNDING * max(abs(first), abs(last), abs(t_start), abs(needed))
    if first > t_start + slack or last < needed - slack:
        what = f"the profile covers {first:g} s to {last:g} s, but the run {t_start:g} s to {needed:g} s"
        yield Defect(str(place.key("times_s")), what, "extend the table, or shorten the run")


def _smooth_step_start(step: SmoothStep) -> tuple[float, float]:
    """35 x^4 - 84 x^5 + 70 x^6 - 20 x^7 and its rate 140 x^3 (1 - x)^3 at t = 0."""
    x = min(max(-step.start_s / step.duration_s, 0.0), 1.0)
    rise = step.end_value - step.start_value
    blend = x**4 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x)))
    return step.start_value + rise * blend, rise * 140.0 * (x * (1.0 - x)) ** 3 / step.duration_s
