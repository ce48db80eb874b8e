"""Default ladders of fixed steps, each half the one before, for the scene's fastest motion and the run's duration."""

from __future__ import annotations

from itertools import pairwise
from math import ceil, floor, log2, log10
from typing import TYPE_CHECKING

from crosscheck.engines.contract import USUAL_S as USUAL_S  # the name that engines outside this package import
from crosscheck.engines.contract import Effort

if TYPE_CHECKING:  # it loads scipy, which a worker does without
    from crosscheck.engines.pace import Pace
    from flexmb.typing import Real

LEAST, MOST = 400, 1_000_000
"""Bounds of the number of steps: at the coarsest effort at least, at the finest at most. A run whose fastest motion
needs more steps needs efforts of its own and an implicit method."""
FINE, TURN, VIBRATION = 0.0125, 0.1, 1.0
"""Angles (rad) in a coarsest step: the wanted one of whatever is fastest; the largest of any motion; the largest of
elastic vibrations (the classical Runge-Kutta method is stable up to 2.8)."""


def ladder(method: str, pace: Pace, duration_s: float, rungs: int, usual: int = 8000) -> tuple[Effort, ...]:
    """Steps of `method` by halves. The coarsest has the wanted angle, but a run has about `usual` of them at most."""
    wanted = min(max(pace) / FINE, usual / duration_s)
    needed = max(pace.motion / TURN, pace.elastic / VIBRATION)
    coarsest = _round(1.0 / max(wanted, needed, LEAST / duration_s))
    finest = 2 ** (rungs - 1)
    coarsest = max(coarsest, duration_s * finest / MOST)
    return tuple(Effort("step", coarsest / 2**rung, method) for rung in range(rungs))


def steps_between_samples(times: Real, step: float) -> int:
    """Number of steps between two samples: the power of two that makes them at most `step`.

    With powers of two the actual steps of two efforts have the ratio of their values. ValueError if the samples
    are not uniform.
    """
    gaps = [later - earlier for earlier, later in pairwise(times)]
    if max(gaps) - min(gaps) > 1e-9 * times[-1]:
        raise ValueError("fixed steps need uniformly spaced output times")
    return 2 ** max(0, ceil(log2(gaps[0] / step) - 1e-9))


def _round(step: float) -> float:
    """The next lower of 1, 2 and 5 times a power of ten: it divides most sample intervals."""
    power = floor(log10(step))
    leading = step / 10.0**power
    return float(f"{5 if leading >= 5.0 else 2 if leading >= 2.0 else 1}e{power}")
