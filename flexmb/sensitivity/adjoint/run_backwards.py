"""A whole run backwards: its smooth parts, and between them what events and sampled controllers do, transposed.

The gradient that is carried backwards belongs to an extended state: the values at which events hold coordinates, y, and
the signals and states of sampled controllers. What is left on the way belongs to the parameters. Directions are in the
order of `StateDirections`. Events, instants of controllers, and channels at the instants of the scalar are
differentiated along all of them by the dual numbers of `flexmb.sensitivity.parts`: they are few, beside the stages of
steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexmb.control import loop
from flexmb.control.feedback import Feedback
from flexmb.integrate.control import ACCEPTED
from flexmb.integrate.problem import Clock
from flexmb.integrate.settings import Settings
from flexmb.jit.direct import addresses
from flexmb.jit.pointer import REAL, STATUS, VECTOR, VOID
from flexmb.run.driver import Leg
from flexmb.run.propagate import Integration, integration
from flexmb.scene.events import Latch
from flexmb.sensitivity.adjoint.arc import Arc, IntegratedMotion, Plain, StepCost
from flexmb.sensitivity.adjoint.part import PassedPart, StateDirections
from flexmb.sensitivity.adjoint.sampling import SampledLoop
from flexmb.sensitivity.blocks import ObservedRates
from flexmb.sensitivity.channels import Seen, channels, value
from flexmb.sensitivity.gate import Admitted
from flexmb.sensitivity.leg import Course, Variation, clock_of_leg
from flexmb.sensitivity.parts import Passage
from flexmb.sensitivity.scalars import Probe, ScalarTerm, TimeIntegral
from flexmb.typing import Index, Real


class ChannelRates:
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


class Left(NamedTuple):
    """What is known at the end of a part: how its end moves (D,), and the integrands there."""

    dt: Real
    integrands: list[float]


class Adjoint:
    """The gradient of a scalar by many numbers.

    value: of the scalar; cost: of the steps; both are known after the call.
    """

    def __init__(self, admitted: Admitted, terms: Sequence[ScalarTerm], settings: Settings) -> None:
        self._admitted, self._terms, self._settings = admitted, terms, settings
        self._numbers = admitted.numbers
        self.value = 0.0
        self.cost = StepCost(0, 0, 0, 0)

    def __call__(self, course: Sequence[Leg]) -> Real:
        """The gradient (P,)."""
        events = self._admitted.system.scene.events
        latches = [action for event in events for action in event.actions if isinstance(action, Latch)]
        with integration(course[0].system, "articulated", 0.0, self._settings.integrator) as solve:
            y, _ = self._begun(solve, course[0])
            made = None if solve.feedback is None else solve.feedback.running
            memory = 0 if made is None else len(made.signal) + len(made.state)
        self._places = StateDirections(
            len(self._numbers), tuple(dict.fromkeys(latch.coordinate for latch in latches)), len(y), memory
        )
        gradient, rows = np.zeros(self._places.size), dict[int, Real]()
        for part in reversed(self._forwards(course)):
            gradient = part.passed(gradient, rows)
            if part.arc is not None:
                self.cost = self.cost.plus(part.arc.cost)
        return gradient[: len(self._numbers)]

    def _forwards(self, course: Sequence[Leg]) -> list[PassedPart]:
        """Record all parts, with what the scalar adds in them, and what events and controllers do."""
        places, t_end = self._places, course[-1].raw.t
        numbers = [*self._numbers, *[None] * (places.size - len(self._numbers))]
        length = t_end - course[0].begin.state.t
        passage = Passage(self._admitted, numbers, np.ones(places.size), self._settings, length)
        probes = self._probes(t_end, self._cuts(course))
        found, left, loops = list[PassedPart](), None, None
        for i, leg in enumerate(course):
            held = {} if passage.after is None else passage.after.held
            if passage.after is not None:
                passage.after = passage.after._replace(held={name: places.held(name) for name in held})
            blocks, start, stop, is_last = passage.blocks(leg), leg.begin.state.t, leg.raw.t, i + 1 == len(course)
            with integration(leg.system, "articulated", 0.0, self._settings.integrator) as solve:
                y, clock = self._begun(solve, leg)
                loops = passage.loops(solve, loops, is_last and bool(i) and start == stop)
                variation = Variation(leg, blocks, loops)
                sampling = None if loops is None else SampledLoop(variation, loops, places.memory, places.size)
                at = passage.begun(variation, y)
                own = {t: probe for t, probe in probes.items() if start <= t and (t < stop or is_last)}
                due = [] if sampling is None else sampling.times(start, stop, is_last)
                ends = sorted({start, *own, *due, stop})
                plain = Plain(blocks.system)
                arc = None
                if stop > start:
                    motion = IntegratedMotion(plain.addresses, True) if loops is None else self._controlled(solve, leg)
                    steps = int(leg.raw.counts[ACCEPTED])
                    arc = Arc(plain, motion, (y, clock), ends, self._settings, steps)
                part = PassedPart(places, blocks, arc, start, at.Y, held)
                states = [y] * len(ends) if arc is None else arc.states_at(ends)
                seeing = ChannelRates(variation, places.along, self._names, solve.feedback)
                self._see(part, seeing, sampling, own, due, dict(zip(ends, states, strict=True)))
                if left is not None:
                    jumps = np.subtract(left.integrands, self._integrands(seeing, start, y))
                    part.moved = np.asarray(np.sum(jumps) * left.dt)
                found.append(part)
                after = passage.ended(variation, Course(leg.raw.y, places.along))
                moves = bool(np.any(after.dt))
                left = Left(after.dt, self._integrands(seeing, stop, leg.raw.y)) if moves else None
        return found

    def _see(
        self, part: PassedPart, seeing: ChannelRates, sampling: SampledLoop | None, probes: dict[float, list[Probe]],
        due: Sequence[float], states: dict[float, Real],
    ) -> None:  # fmt: skip
        """The instants of controllers and of the scalar in a part of the run, in order of time."""
        if sampling is not None and part.begin not in due:
            part.instants[part.begin] = sampling.held(part.begin)
        for t in sorted({*probes, *due}):
            if sampling is not None and t in due:
                part.instants[t] = sampling.acted(t, Course(states[t], self._places.along))
            if t in probes:
                part.added[t] = self._added(seeing, t, states[t], probes[t])

    def _begun(self, solve: Integration, leg: Leg) -> tuple[Real, Clock]:
        start = leg.begin.state.t
        return clock_of_leg(solve, leg, np.array([start, max(leg.raw.t, start)]), self._settings)

    def _controlled(self, solve: Integration, leg: Leg) -> IntegratedMotion:
        """The motion with its controllers."""

        def begin() -> Index:
            self._begun(solve, leg)
            assert solve.feedback is not None
            rhs, made, _ = solve.feedback.motion
            moving = addresses(rhs, STATUS, REAL, VECTOR, VECTOR, made, made)
            return np.array([moving[0], addresses(loop.project, VOID, REAL, VECTOR, made)[0], *moving[1:]])

        return IntegratedMotion(begin, False)

    @property
    def _names(self) -> list[str]:
        return [name for term in self._terms for name in term.channels]

    def _cuts(self, course: Sequence[Leg]) -> list[float]:
        """Where something may jump (s): the ends of the parts, the instants of controllers, switches of functions."""
        cuts = [leg.raw.t for leg in course]
        for leg in course:
            with integration(leg.system, "articulated", 0.0, self._settings.integrator) as solve:
                ends = self._begun(solve, leg)[1].segment_ends.tolist()
            cuts += [t for t in ends if leg.begin.state.t < t < leg.raw.t]
        return sorted(set(cuts))

    def _probes(self, t_end: float, cuts: Sequence[float]) -> dict[float, list[Probe]]:
        """The instants of all terms, by time."""
        probes = dict[float, list[Probe]]()
        for term in self._terms:
            for probe in term.probes(t_end, cuts):
                probes.setdefault(probe.t, []).append(probe)
        return probes

    def _added(self, seeing: ChannelRates, t: float, y: Real, probes: Sequence[Probe]) -> Real:
        """The gradient (D,) that the scalar adds at one instant; its value there is added to `value`."""
        values, rates = seeing.at(t, y)
        total = np.zeros(self._places.size)
        for probe in probes:
            self.value += probe.value(values[probe.channel])
            total += probe.slope(values[probe.channel]) * rates[probe.channel]
        return total

    def _integrands(self, seeing: ChannelRates, t: float, y: Real) -> list[float]:
        """The values of all integrands."""
        integrals = [term for term in self._terms if isinstance(term, TimeIntegral)]
        values = seeing.at(t, y)[0] if integrals else {}
        return [term.at(t).value(values[term.channel]) for term in integrals]
