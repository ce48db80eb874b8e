"""Channels of a run and their derivatives along given directions, at single states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.sensitivity.blocks import ObservedRates
from flexmb.sensitivity.channels import Seen, channels, value
from flexmb.sensitivity.leg import Course, Variation
from flexmb.typing import Real


class Seeing:
    """Some channels in one part of a run. along (n,D): the directions of the state."""

    def __init__(self, variation: Variation, along: Real, names: Sequence[str], feedback: Feedback | None) -> None:
        self._variation, self._along = variation, along
        self._known = channels(variation.blocks.system, {} if feedback is None else feedback.names)
        self._signals = any(name.startswith("signal.") for name in names)
        self._names = list(dict.fromkeys(names))
        system = variation.blocks.system
        of_state = {name for names in system.state_names for name, _ in names} | {"work"}
        self._observed = any(name not in of_state and not name.startswith("signal.") for name in self._names)

    def at(self, t: float, y: Real) -> tuple[dict[str, float], dict[str, Real]]:
        """Values, and derivatives (D,), by name of the channel, at the state y (n,)."""
        observed = own = None
        if self._observed:
            observed = self._variation.observed_at(t, Course(y, self._along))
            own = ObservedRates(observed.row, observed.row[:, None])
        signals = of_signals = None
        if self._signals and self._variation.loops is not None:
            self._variation.take(Course(y, self._along))
            of_signals, rates_of_signals = self._variation.loops.look(t)
            signals, of_signals = rates_of_signals, of_signals[:, None]
        seen, itself = Seen(self._along, observed, signals), Seen(y[:, None], own, of_signals)
        values, rates = dict[str, float](), dict[str, Real]()
        for name in self._names:
            if name in self._known:
                channel = self._known[name]
                values[name] = value(self._variation.blocks.system, channel, name, itself)
                rates[name] = channel(seen)
            else:  # the load of a drive on a coordinate that is free here
                values[name], rates[name] = 0.0, np.zeros(self._along.shape[1])
        return values, rates
