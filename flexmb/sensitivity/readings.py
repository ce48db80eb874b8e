"""What a scalar of a run reads on the way: its instants, and its channels there with their derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.integrate.settings import Settings
from flexmb.run.driver import Leg
from flexmb.run.propagate import integration
from flexmb.sensitivity.blocks import ObservedRates
from flexmb.sensitivity.channels import Seen, channels, value
from flexmb.sensitivity.leg import Course, Variation, clock_of_leg
from flexmb.sensitivity.parts import Passage
from flexmb.sensitivity.scalars import Probe, ScalarTerm, TimeIntegral
from flexmb.typing import Real

Rates = tuple[dict[str, float], dict[str, Real]]
"""Values of channels, and their derivatives (D,), by name."""


class ChannelRates:
    """Some channels in one part of a run."""

    def __init__(self, variation: Variation, names: Sequence[str], feedback: Feedback | None) -> None:
        self._variation = variation
        self._known = channels(variation.blocks.system, {} if feedback is None else feedback.names)
        self._signals = any(name.startswith("signal.") for name in names)
        self._names = list(dict.fromkeys(names))
        system = variation.blocks.system
        of_state = {name for names in system.state_names for name, _ in names} | {"work"}
        self._observed = any(name not in of_state and not name.startswith("signal.") for name in self._names)

    def at(self, t: float, at: Course) -> Rates:
        """Values, and derivatives (D,) along the directions of the state."""
        observed = own = None
        if self._observed:
            observed = self._variation.observed_at(t, at)
            own = ObservedRates(observed.row, observed.row[:, None])
        signals = of_signals = None
        if self._signals and self._variation.loops is not None:
            self._variation.take(at)
            of_signals, rates_of_signals = self._variation.loops.look(t)
            signals, of_signals = rates_of_signals, of_signals[:, None]
        seen, itself = Seen(at.Y, observed, signals), Seen(at.y[:, None], own, of_signals)
        values, rates = dict[str, float](), dict[str, Real]()
        for name in self._names:
            if name in self._known:
                channel = self._known[name]
                values[name] = value(self._variation.blocks.system, channel, name, itself)
                rates[name] = channel(seen)
            else:  # the load of a drive on a coordinate that is free here
                values[name], rates[name] = 0.0, np.zeros(at.Y.shape[1])
        return values, rates


class Left(NamedTuple):
    """What is known at the end of a part: how its end moves (D,), and the integrands there."""

    dt: Real
    integrands: list[float]


class ScalarReading:
    """The scalar that is the sum of some terms. value: of those of its instants that were read."""

    def __init__(self, terms: Sequence[ScalarTerm], course: Sequence[Leg], settings: Settings) -> None:
        """course: the parts of the run between events."""
        self.value = 0.0
        self.names = [name for term in terms for name in term.channels]
        self._integrals = [term for term in terms if isinstance(term, TimeIntegral)]
        self._probes = dict[float, list[Probe]]()
        cuts = _cuts(course, settings)
        for term in terms:
            for probe in term.probes(course[-1].raw.t, cuts):
                self._probes.setdefault(probe.t, []).append(probe)

    def within(self, leg: Leg, is_last: bool) -> dict[float, list[Probe]]:
        """The instants of a part of the run, by time; what is due at an event belongs to the part after it."""
        start, stop = leg.begin.state.t, leg.raw.t
        return {t: probes for t, probes in self._probes.items() if start <= t and (t < stop or is_last)}

    def added(self, probes: Sequence[Probe], seen: Rates) -> Real:
        """The gradient (D,) that the scalar adds at one instant; its value there is added to `value`."""
        values, rates = seen
        total = np.zeros(())
        for probe in probes:
            self.value += probe.value(values[probe.channel])
            total = total + probe.slope(values[probe.channel]) * rates[probe.channel]
        return total

    def integrands(self, seeing: ChannelRates, t: float, at: Course) -> list[float]:
        """The values of all integrands: an integral changes by their jumps where an event moves."""
        values = seeing.at(t, at)[0] if self._integrals else {}
        return [term.at(t).value(values[term.channel]) for term in self._integrals]


def _cuts(course: Sequence[Leg], settings: Settings) -> list[float]:
    """Where something may jump (s): the ends of the parts, the instants of controllers, switches of functions."""
    cuts = [leg.raw.t for leg in course]
    for leg in course:
        start, stop = leg.begin.state.t, leg.raw.t
        with integration(leg.system, "articulated", 0.0, settings.integrator) as solve:
            _, clock = clock_of_leg(solve, leg, np.array([start, max(stop, start)]), settings)
        cuts += [t for t in clock.segment_ends.tolist() if start < t < stop]
    return sorted(set(cuts))


def summed_forwards(passage: Passage, reading: ScalarReading, course: Sequence[Leg], directions: int) -> Real:
    """The derivatives (P,) of a scalar along the `directions` of a passage, by those of the state at each instant that
    it reads: for runs that the adjoint does not pass. It costs as much as `sensitivities` by as many numbers."""
    total, left = np.zeros(directions), None
    for part in passage.followed(course, reading.within):
        seeing = ChannelRates(part.variation, reading.names, part.feedback)
        states = [part.variation.parted(z) for z in part.states]
        start, stop = float(part.times[0]), float(part.times[-1])
        if left is not None:
            total += np.sum(np.subtract(left.integrands, reading.integrands(seeing, start, states[0]))) * left.dt
        own = reading.within(part.leg, part.is_last)
        for t, at in zip(part.times.tolist(), states, strict=True):
            if t in own:
                total += reading.added(own[t], seeing.at(t, at))
        integrands = reading.integrands(seeing, stop, states[-1])
        left = Left(passage.ended(part.variation, part.before).dt, integrands)
    return total
