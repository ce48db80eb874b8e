"""Events without end: so many of them in so little time that a run would never come to its end."""

from __future__ import annotations

import numpy as np

from flexmb.typing import Real

# A run ends where so many instants of events lie within this part of it, and where fewer do between which nothing
# moves further than the error that is allowed. Sequences of events without end come to any pace, for their intervals
# shrink by a factor from one to the next.
MANY, FEW, PART = 1000, 50, 1e-6
ULPS = 16.0  # events that follow each other within so many roundings of time make no progress


class Chattering:
    """Counts the instants of events of a run from t_start to t_end (s)."""

    def __init__(self, t_start: float, t_end: float, atol: float) -> None:
        self._soon, self._atol = PART * (t_end - t_start), atol
        self._instants: list[float] = []
        self._idle: list[float] = []
        """Times of the last events, between which nothing moved."""

    def count(self, t_before: float, t: float, speeds: tuple[Real, Real]) -> None:
        """An instant of events at t (s), after a segment with these speeds (nu,) at its start and its end."""
        fastest, lasted = max(np.max(np.abs(u), initial=0.0) for u in speeds), t - t_before
        if fastest * lasted > self._atol and lasted > ULPS * np.spacing(abs(t)):
            self._idle.clear()
        self._idle.append(t)
        self._instants.append(t)

    @property
    def is_endless(self) -> bool:
        """Whether there is no end of it."""
        return any(
            len(times) >= many and times[-1] - times[-many] < self._soon
            for times, many in ((self._idle, FEW), (self._instants, MANY))
        )
