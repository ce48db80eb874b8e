"""How a trajectory was computed: its system, for quantities that the run did not store, and a way to repeat the run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexmb.integrate.settings import FINEST_RTOL, Settings
from flexmb.run.channels import channels_of, distance
from flexmb.run.run_arrays import RunArrays
from flexmb.system.tree_system import System
from flexmb.typing import Real

TIGHTER = 100.0  # factor on rtol and atol: the error of the second run is a hundredth of the first run's
HALF = 4.0 / 3.0  # error over its change when the step is halved, for a method of order two; smaller for higher orders


@dataclass(frozen=True)
class Making:
    """The system of a run, its output times (T,) s and settings, and a function that repeats it with other settings."""

    system: System
    times: Real
    settings: Settings
    again: Callable[[Settings], RunArrays]


def error_estimate(trajectory: RunArrays, made_by: Making) -> dict[str, Real]:
    """Estimated error (T,) of every channel, from a second run with rtol and atol / 100, or with half the step.

    NaN after the end of a second run that stops earlier. ValueError if the settings cannot be made tighter.
    """
    settings, share = _tighter(made_by.settings)
    other = channels_of(made_by.again(settings))
    found = {}
    for name, values in channels_of(trajectory).items():
        common = min(len(values), len(other[name]))
        apart = np.full(len(values), np.nan)
        apart[:common] = share * distance(name, values[:common], other[name][:common])
        found[name] = apart
    return found


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
