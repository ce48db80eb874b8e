"""A signal that an event watches, at the end of a part of a run: its derivative by parameters, and its rate in time."""

from __future__ import annotations

import numpy as np

from flexmb.sensitivity.leg import Course, Variation
from flexmb.typing import Real

# Step of the differences in time, relative to the part of the run: with Richardson's extrapolation their error is its
# fourth power, 1e-12 of the signal's variation over the part.
STEP = 1e-3
NEXT = 0.4  # of the distance to the nearest sampling instant, which no difference may cross


class Watched:
    """One number of a sensor or controller; the loops of the variation are replayed."""

    def __init__(self, variation: Variation, name: str) -> None:
        assert variation.loops is not None  # an event that watches a signal has them
        self._variation, self._loops = variation, variation.loops
        self._place = self._loops.place_of(name)
        self.is_sampled = self._loops.is_sampled(name)
        """Whether it is an output of a sampled controller, which changes at its instants only."""
        self._t = variation.leg.raw.t

    def change(self, end: Course) -> Real:
        """(P,) of the signal just before the events, at fixed time."""
        self._variation.take(end)
        _, rates = self._loops.look(self._loops.just_before(self._t))
        return np.asarray(rates[self._place])

    def rate(self, end: Course, before: Course) -> float:
        """Per second, along the motion: `before` are the rates of the state there."""
        h = STEP * (self._t - self._variation.leg.begin.state.t)
        near = self._loops.distance_to_instants(self._t)
        h = min(h, NEXT * near)

        def difference(h: float) -> float:
            ahead, behind = (self._value(end, before, side * h) for side in (1.0, -1.0))
            return (ahead - behind) / (2.0 * h)

        return (4.0 * difference(0.5 * h) - difference(h)) / 3.0

    def _value(self, end: Course, before: Course, later: float) -> float:
        """The signal where the motion leads in a straight line; the bend of its path cancels in central differences."""
        self._variation.take(Course(end.y + later * before.y, np.zeros_like(end.Y)))
        return float(self._loops.look(self._t + later)[0][self._place])
