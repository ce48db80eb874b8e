"""Follows a finished run again with the derivatives of its state: from part to part, and across the events between."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.integrate.settings import Settings
from flexmb.run.driver import Leg
from flexmb.run.propagate import Integration, integration
from flexmb.run.trajectory import Trajectory
from flexmb.sensitivity.channels import Chosen, Seen, channels
from flexmb.sensitivity.gate import Admitted
from flexmb.sensitivity.leg import Course, Variation, clock_of_leg
from flexmb.sensitivity.passage import Passage
from flexmb.typing import Real

# Derivatives are integrated as changes by this part of each number. The error of a step is held below rtol times them
# plus atol, so that what changes by less than atol if a number changes by 3 % does not shorten steps.
SHARE = 0.03
TOGETHER = 256  # samples whose observables are kept until channels are taken from all of them

EventTimes = list[tuple[str, float, Real]]
"""Name, time (s), derivatives (P,) of the time of each event."""


class Following:
    """One run, followed with scaled derivatives: each is per SHARE of the `scale` of its number."""

    def __init__(self, admitted: Admitted, settings: Settings, trajectory: Trajectory, outputs: Chosen) -> None:
        self._scales = np.array([SHARE * number.scale for number in admitted.numbers])
        self._settings, self._trajectory, self._outputs = settings, trajectory, outputs
        length = float(trajectory.t[-1] - trajectory.t[0])
        self._passage = Passage(admitted, admitted.numbers, self._scales, settings, length)
        self._derivatives = np.full((*outputs.values.shape, len(self._scales)), np.nan)
        self._events: EventTimes = []

    def __call__(self, course: Sequence[Leg]) -> tuple[Real, EventTimes]:
        """Derivatives (T,K,P) of the outputs, and those of the times of events."""
        loops = None
        for i, leg in enumerate(course):
            blocks = self._passage.blocks(leg)
            with integration(leg.system, "articulated", 0.0, self._settings.integrator) as solve:
                is_last, stop = i + 1 == len(course), leg.raw.t
                times = self._times(leg, is_last)
                y, clock = clock_of_leg(
                    solve, leg, np.unique([leg.begin.state.t, *self._trajectory.t[times], stop]), self._settings
                )
                loops = self._passage.loops(solve, loops, is_last and bool(i) and leg.begin.state.t == stop)
                variation = Variation(leg, blocks, loops)
                at = self._passage.begun(variation, y)
                states = variation.joined(at)[None]
                if stop > leg.begin.state.t:
                    states = variation.integrate(at, clock.times, clock, self._settings)
                before = Course(leg.raw.y, variation.parted(states[-1]).Y)
                self._see(variation, solve, clock.times, states, times, is_last)
                variation_after = self._passage.ended(variation, before)
                self._events += [(crossing.event.name, stop, crossing.dt) for crossing in variation_after.crossings]
        self._derivatives[np.isnan(self._outputs.values)] = np.nan  # of loads that closures leave undetermined
        return self._derivatives / self._scales, [(name, t, dt / self._scales) for name, t, dt in self._events]

    def _times(self, leg: Leg, is_last: bool) -> slice:
        """The numbers of the output times of a part of the run."""
        t, start, stop = self._trajectory.t, leg.begin.state.t, leg.raw.t
        first = int(np.searchsorted(t, start, side="left"))
        if is_last and start == stop:
            return slice(len(t) - 1, len(t))
        last = int(np.searchsorted(t, stop, side="right" if is_last else "left"))
        return slice(first, last)

    def _see(
        self,
        variation: Variation,
        solve: Integration,
        times: Real,
        states: Real,
        wanted: slice,
        is_last: bool,
    ) -> None:
        """Derivatives of the outputs at the output times of a part of the run, from its states (T,.) at `times`."""
        loops, system = variation.loops, variation.blocks.system
        names = {} if solve.feedback is None else solve.feedback.names
        known = channels(system, names)
        if loops is not None:
            if is_last:
                variation.put(float(times[-1]), states[-1])  # controllers act at the end of the run
            loops.replay()
        places = np.searchsorted(times, self._trajectory.t[wanted])
        for first in range(0, len(places), TOGETHER):
            own = slice(first, first + TOGETHER)
            seen = self._seen(variation, times[places[own]], states[places[own]])
            samples = slice(wanted.start + first, min(wanted.start + first + TOGETHER, wanted.stop))
            for k, name in enumerate(self._outputs.names):
                if name in known:
                    self._derivatives[samples, k] = known[name](seen)
                elif ".drive[" in name:  # of a coordinate that is free here
                    self._derivatives[samples, k] = 0.0

    def _seen(self, variation: Variation, times: Real, states: Real) -> Seen:
        """What is known at times (T,), in states (T,.) that are joined with their derivatives."""
        loops, signals = variation.loops, list[Real]()
        observed = variation.observed(times, states) if self._outputs.observed and len(times) else None
        if loops is not None and any(name.startswith("signal.") for name in self._outputs.names):
            if observed is not None:
                loops.replay()  # once more from the first of these times
            for t, z in zip(times.tolist(), states, strict=True):
                variation.take(variation.parted(z))
                signals.append(loops.look(t)[1])
        return Seen(variation.parted(states).Y, observed, np.array(signals) if signals else None)
