"""The times of a run: its output times, and the memory that they take, which is estimated before the scene is built;
the times of functions of time that no step may cross, and the domain of these.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple, assert_never

import numpy as np

from flexmb.building.numbering import speeds_at_least
from flexmb.integrate.problem import Clock
from flexmb.integrate.settings import Settings
from flexmb.scene.check import check_run
from flexmb.scene.check.walk import values
from flexmb.scene.convert import ROOT
from flexmb.scene.functions import Constant, ControlSignal, Function, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table
from flexmb.scene.schema import Scene
from flexmb.scene.sizes import refuse_bytes, refuse_large_matrix
from flexmb.scene.tree import watches_signals
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.typing import Real

# Bytes per number, which is stored in a row and again by name; bytes per sample for its time and for NumPy's overhead.
_NUMBER_BYTES, _SAMPLE_BYTES = 16, 200
_APART = 1e-12  # of the largest time, between samples that rounding cannot bring to the same one
_FEWER = "ask for fewer, or divide the run into several"


def sample_times(samples: int | Sequence[float] | Real, t_end: float, t_start: float = 0.0) -> Real:
    """Output times (T,) from t_start to t_end (s); samples: their number, or the times. ValueError or TypeError for
    invalid ones."""
    if type(samples) is int or np.ndim(samples) == 0:
        number = arguments.whole("samples", samples)
        if number < 2:
            raise ValueError(f"samples is {number}: ask for at least 2 output times, the start and the end")
        _refuse_samples(number, _SAMPLE_BYTES)
        steps = np.arange(number, dtype=np.float64)  # as `linspace`, which takes three times as long
        equal: Real = steps * ((t_end - t_start) / (number - 1)) + t_start
        equal[-1] = t_end
        if t_end - t_start > number * _APART * max(abs(t_start), abs(t_end)) or _increase(equal):
            return equal
        raise ValueError(f"samples is {number}: too many to be distinct from {t_start:g} to t_end = {t_end:g} s")
    times = arguments.array("samples", samples)
    increasing = times.ndim == 1 and len(times) > 1 and _increase(times)
    if not (increasing and times[0] == t_start and times[-1] == t_end):
        raise ValueError(
            f"the output times must increase from {t_start:g} to t_end = {t_end:g} s: sort them and add both ends"
        )
    return times.copy()


def _increase(times: Real) -> bool:
    return bool((times[1:] > times[:-1]).all())


def refuse_large_run(scene: Scene | System, samples: int, settings: Settings, algorithm: Algorithm) -> None:
    """ValueError if the outputs of a run, or the matrices of its method or its algorithm, would not fit into memory.

    Of a checked scene it is estimated before anything is built or compiled.
    """
    _refuse_samples(samples, sample_bytes(scene))
    nu = _speeds(scene)
    if matrices := settings.integrator.matrices:
        others = 'take method "dop853" or "rk4", whose cost is O(N)'
        refuse_large_matrix(2 * nu, f'method "{settings.method}"', others, matrices)
    if matrices := algorithms.chosen(algorithm).matrices:
        refuse_large_matrix(nu, f'algorithm "{algorithm}"', 'take "articulated", which needs none', matrices)


def _refuse_samples(samples: int, each: int) -> None:
    refuse_bytes(float(samples) * each, f"samples is {samples}: outputs take", _FEWER)


def _speeds(scene: Scene | System) -> int:
    return speeds_at_least(scene) if isinstance(scene, Scene) else scene.nu


def sample_bytes(scene: Scene | System) -> int:
    """Bound (bytes) of the memory for one output time of a run."""
    nu = _speeds(scene)
    scene = scene if isinstance(scene, Scene) else scene.scene
    loaded = (scene.hinges, scene.wheels, scene.constraints, scene.point_masses, scene.connectors)
    places = sum(map(len, loaded))
    numbers = 4 * nu + len(scene.hinges) + 24 * len(scene.markers) + 6 * places + 11  # a quaternion has one more in q
    return _NUMBER_BYTES * numbers + _SAMPLE_BYTES


MOST_TURNS = 1_000_000  # extremes of a sine in a run; for more, a step for each would exceed max_steps


class Timing(NamedTuple):
    """switches (s), increasing: times at which a function jumps or is not smooth. start, end (s): the interval in which
    all functions are defined. sines, and knots (s) of tables, determine where functions have extremes."""

    switches: tuple[float, ...]
    start: float
    end: float
    sines: tuple[Sine, ...]
    knots: tuple[float, ...]

    def between(self, t_start: float, t_end: float) -> list[float]:
        """Switches (s) in (t_start, t_end), none of which a step may cross."""
        return [time for time in self.switches if t_start < time < t_end]

    def turns(self, t_start: float, t_end: float) -> list[float]:
        """Extremes of sines and knots of tables in (t_start, t_end): between them functions rarely turn twice."""
        times = {time for time in self.knots if t_start < time < t_end}
        for sine in self.sines:
            half, phase = np.pi / abs(sine.angular_frequency_rad_s), sine.phase_rad / sine.angular_frequency_rad_s
            first, last = np.ceil((t_start + phase) / half - 0.5), np.floor((t_end + phase) / half - 0.5)
            if last - first <= MOST_TURNS:
                extremes = (np.arange(first, last + 1.0) + 0.5) * half - phase
                times.update(extremes[(extremes > t_start) & (extremes < t_end)].tolist())
        return sorted(times)


def timing(scene: Scene) -> Timing:
    """The timing of all functions of a scene."""
    switches, start, end = set[float](), -inf, inf
    sines, knots = list[Sine](), set[float]()
    for _, _, function in values(ROOT, scene):
        if not isinstance(function, Function):
            continue
        match function:
            case Pulse(start_s=begin, duration_s=duration) | SmoothStep(start_s=begin, duration_s=duration):
                switches |= {begin, begin + duration}
            case SpinUp(duration_s=duration):
                switches.add(duration)
            case Table(times_s=times):
                start, end = max(start, times[0]), min(end, times[-1])
                knots.update(times)
            case Sine(amplitude=amplitude, angular_frequency_rad_s=frequency):
                if amplitude and frequency:
                    sines.append(function)
            case Constant() | Ramp() | ControlSignal():
                pass  # these have no switches
            case _:
                assert_never(function)
    return Timing(tuple(sorted(switches)), start, end, tuple(sines), tuple(knots))


def timing_of(system: System) -> Timing:
    """The timing of a system's scene, which is computed once."""
    if Timing not in system.kept:
        system.kept[Timing] = timing(system.scene)
    found: Timing = system.kept[Timing]
    return found


def segment_ends(system: System, t_start: float, t_end: float, equal_steps: bool, breaks: bool = False) -> Real:
    """The segment ends of a run's clock: see `flexmb.integrate.problem.Clock`. breaks: a segment ends at t_end.

    If events watch signals, segments also end where functions turn: error control resolves the motion only, and a load
    on a body that is held varies without any motion.
    """
    timing = timing_of(system)
    ends, is_switch = timing.between(t_start, t_end), breaks or t_end in timing.switches
    if equal_steps:
        return np.array([*ends, *[t_end] * is_switch, inf])
    if watches_signals(system.scene):
        ends = sorted({*ends, *timing.turns(t_start, t_end)})
    return np.array([*ends, t_end, *[t_end] * is_switch])


def clock_of(system: System, t_start: float, times: Real, equal_steps: bool, breaks: bool) -> Clock:
    """The clock of a run from t_start (s) with these output times (T,) s; breaks: see `segment_ends`.

    A leap over a singular position near the end of the run may pass the end, up to the next switch of a function.
    """
    found, t_end = timing_of(system), times[-1]
    ends = segment_ends(system, t_start, t_end, equal_steps, breaks)
    switches = [time for time in found.switches if time >= t_end]
    return Clock(times, ends, -inf if breaks else float(min([*switches, found.end])))


def refuse_times(system: System, t_start: float, t_end: float) -> None:
    """SceneError unless t_start < t_end are finite and every profile covers the run."""
    timing = timing_of(system)
    if not max(timing.start, -1e300) <= t_start < t_end <= min(timing.end, 1e300):
        check_run(system.scene, t_end, t_start)
