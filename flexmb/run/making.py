"""How a trajectory was made: what asks more of a run than it has kept needs its system, and can repeat it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from flexmb.integrate.settings import FINEST_RTOL, Settings
from flexmb.run.channels import channels_of, distance
from flexmb.run.run_arrays import RunArrays
from flexmb.system.tree_system import System
from flexmb.typing import Real

TIGHTER = 100.0  # of rtol and atol: the error of the second run is a hundredth of the first one's
HALF = 4.0 / 3.0  # error over its change where the step is halved, of a method of order two; less of higher orders


@dataclass(frozen=True)
class Making:
    """The system of a run, its output times (T,) s and settings, and how to run the same with other settings."""

    system: System
    times: Real
    settings: Settings
    again: Callable[[Settings], RunArrays]


def error_estimate(trajectory: RunArrays, made_by: Making) -> dict[str, Real]:
    """Distance (T,) of every channel from that of a second run, a hundred times as tight or in half the step.

    NaN after the end of a second run that stops earlier. ValueError where the settings cannot be tighter.
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
    """The settings of the second run, and the error of the first one over the distance of the two."""
    if given.integrator.fixed:
        assert given.step is not None  # of methods of fixed steps
        finer = replace(given, step=given.step / 2.0, max_steps=2 * given.max_steps + 1)
        return replace(finer, rtol=max(given.rtol / TIGHTER, FINEST_RTOL), atol=given.atol / TIGHTER), HALF
    if given.rtol / TIGHTER < FINEST_RTOL:
        raise ValueError(
            f"rtol is {given.rtol:g}, and double precision resolves {FINEST_RTOL:.1e}: no run is {TIGHTER:g} times as "
            f"tight; estimate the error of a run with rtol {TIGHTER * FINEST_RTOL:.1e} or more"
        )
    return replace(given, rtol=given.rtol / TIGHTER, atol=given.atol / TIGHTER, max_steps=10 * given.max_steps), 1.0
