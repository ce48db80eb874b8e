"""Fixed steps by default: a ladder of halves that fits the scene's pace and the run's duration."""

from __future__ import annotations

from math import floor, log10
from typing import TYPE_CHECKING

from crosscheck.engines.contract import Effort

if TYPE_CHECKING:  # it loads scipy, which a worker does without
    from crosscheck.engines.pace import Pace

USUAL_S = 10.0
"""Duration (s) of a run of which nothing is known."""
LEAST, MOST = 400, 1_000_000
"""Steps of a run at its coarsest and at its finest, whatever the scene is. A run in which even the most steps follow
nothing needs efforts of its own, and an implicit method."""
FINE, TURN, VIBRATION = 0.0125, 0.1, 1.0
"""Angles (rad) of a coarsest step: wanted, of whatever is fastest; not to be passed by motion; not to be passed by what
is elastic (the classical Runge-Kutta method is stable to 2.8)."""


def ladder(method: str, pace: Pace, duration_s: float, rungs: int, usual: int = 8000) -> tuple[Effort, ...]:
    """Steps of `method` by halves; the coarsest are fine ones as far as about `usual` of them make the run."""
    wanted = min(max(pace) / FINE, usual / duration_s)
    needed = max(pace.motion / TURN, pace.elastic / VIBRATION)
    coarsest = _round(1.0 / max(wanted, needed, LEAST / duration_s))
    finest = 2 ** (rungs - 1)
    coarsest = max(coarsest, duration_s * finest / MOST)
    return tuple(Effort("step", coarsest / 2**rung, method) for rung in range(rungs))


def _round(step: float) -> float:
    """The next of 1, 2 and 5 times a power of ten below, which divides most intervals between samples."""
    power = floor(log10(step))
    leading = step / 10.0**power
    return float(f"{5 if leading >= 5.0 else 2 if leading >= 2.0 else 1}e{power}")
