"""Chattering (Zeno behaviour): so many events in so short a time that the run would never reach its end."""

from __future__ import annotations

import numpy as np

from flexmb.typing import Real

# A run ends when MANY instants of events, or FEW between which nothing moves by more than `atol`, lie within the
# fraction PART of its duration. A Zeno sequence meets any such criterion: its intervals shrink geometrically.
MANY, FEW, PART = 1000, 50, 1e-6
ULPS = 16.0  # events within ULPS ulp(t) of each other make no progress


class Chattering:
    """Counts the instants of events in a run from t_start to t_end (s)."""

    def __init__(self, t_start: float, t_end: float, atol: float) -> None:
        self._soon, self._atol = PART * (t_end - t_start), atol
        self._instants: list[float] = []
        self._idle: list[float] = []
        """Times of the latest events, between which nothing moved by more than `atol`."""

    def count(self, t_before: float, t: float, speeds: tuple[Real, Real]) -> None:
        """Count an instant of events at t (s) after a segment from t_before with these speeds (nu,) at its two ends."""
        fastest, lasted = max(np.max(np.abs(u), initial=0.0) for u in speeds), t - t_before
        if fastest * lasted > self._atol and lasted > ULPS * np.spacing(abs(t)):
            self._idle.clear()
        self._idle.append(t)
        self._instants.append(t)

    @property
    def is_endless(self) -> bool:
        """Whether the events counted so far amount to chattering."""
        return any(
            len(times) >= many and times[-1] - times[-many] < self._soon
            for times, many in ((self._idle, FEW), (self._instants, MANY))
        )
