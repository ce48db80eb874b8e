"""How a trajectory was computed: its system, altered by events and with drives as controllers have set them, for
quantities that the run did not store; and a way to repeat the run.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from flexmb.integrate.settings import FINEST_RTOL, Settings
from flexmb.run.channels import channels_of, distance
from flexmb.run.run_arrays import RunArrays
from flexmb.scene.check.control import named
from flexmb.system.system import System
from flexmb.typing import Real

TIGHTER = 100.0  # factor on rtol and atol: the error of the second run is a hundredth of the first run's
HALF = 4.0 / 3.0  # error over its change when the step is halved, for a method of order two; smaller for higher orders


@dataclass(frozen=True)
class Making:
    """The system of a run, its output times (T,) s and settings, and a function that repeats it with other settings.

    altered: systems that events have made of it, each with the time (s) of its first output.
    """

    system: System
    times: Real
    settings: Settings
    again: Callable[[Settings], RunArrays]
    altered: tuple[tuple[float, System], ...] = ()


def system_at(made_by: Making, t: float) -> System:
    """The system that the output of a run at a time (s) is of."""
    later = bisect_right(made_by.altered, t, key=lambda entry: entry[0])
    return made_by.altered[later - 1][1] if later else made_by.system


def has_made(made_by: Making, run: RunArrays) -> bool:
    """Whether the run is the one; an event may have ended it between two output times, with one more output."""
    times, last = made_by.times, max(len(run.t) - 1, 0)
    is_its = np.array_equal(run.t[:last], times[:last]) and np.all(run.t[last:] <= times[last])
    return bool(is_its) and (run.q_names, run.u_names) == made_by.system.state_names


def error_estimate(trajectory: RunArrays, made_by: Making) -> dict[str, Real]:
    """Estimated error (T,) of every channel, from a second run with rtol and atol / 100, or with half the step.

    NaN after the end of a second run that stops earlier, and where that has no such channel, as a drive of a coordinate
    that an event holds in the first run only. ValueError if the settings cannot be made tighter.
    """
    settings, share = _tighter(made_by.settings)
    second = made_by.again(settings)
    other, together = channels_of(second), min(len(trajectory.t), len(second.t))
    common = int(np.sum(trajectory.t[:together] == second.t[:together]))  # an event may end the runs at other times
    errors = {}
    for name, values in channels_of(trajectory).items():
        apart = np.full(len(values), np.nan)
        if name in other and other[name].shape[1:] == values.shape[1:]:
            apart[:common] = share * distance(name, values[:common], other[name][:common])
        errors[name] = apart
    return errors


def _tighter(given: Settings) -> tuple[Settings, float]:
    """The settings of the second run, and the ratio of the first run's error to the distance of both runs."""
    if given.integrator.fixed:
        assert given.step is not None  # methods of fixed steps have one
        finer = replace(given, step=given.step / 2.0, max_steps=2 * given.max_steps + 1)
        return replace(finer, rtol=max(given.rtol / TIGHTER, FINEST_RTOL), atol=given.atol / TIGHTER), HALF
    if given.rtol / TIGHTER < FINEST_RTOL:
        raise ValueError(
            f"rtol is {given.rtol:g}, and double precision resolves {FINEST_RTOL:.1e}: a second run cannot be "
            f"{TIGHTER:g} times as tight; estimate the error of a run with rtol {TIGHTER * FINEST_RTOL:.1e} or more"
        )
    return replace(given, rtol=given.rtol / TIGHTER, atol=given.atol / TIGHTER, max_steps=10 * given.max_steps), 1.0


def systems_at(run: RunArrays, made_by: Making) -> Iterator[System]:
    """One system after the other, for each output of a run; with controllers it is used until the next one is asked
    for."""
    return with_drives(run, (system_at(made_by, t) for t in run.t.tolist()))


def with_drives(run: RunArrays, systems: Iterable[System]) -> Iterator[System]:
    """The systems (T) of the outputs of a run with drives as controllers have set them, each for use until the next one
    is asked for."""
    before: System | None = None
    for i, now in enumerate(systems):
        if now is not before:
            before, system = now, _apart(now) if now.signals else now
        for number, signal in system.signals.items():
            at = named(signal.source)
            assert at is not None  # the scene was checked
            system.constants.function["data"][number, 0] = signal.gain * run.signals[at.name][i, at.number or 0]
        yield system


def _apart(system: System) -> System:
    """The same with tables of its own, whose functions of time may be set. No feature of kernels depends on them."""
    own = copy(system)
    own.constants.function.setflags(write=True)
    return own
