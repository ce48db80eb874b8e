"""From one part of a run to the next with derivatives along directions: the tables of each part, and its events.

Directions belong to numbers of the scene, or to none: those of `flexmb.sensitivity.adjoint` change the state itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.integrate.settings import Settings
from flexmb.parameters.numbers import Number
from flexmb.run.driver import Leg
from flexmb.run.propagate import Integration, integration
from flexmb.sensitivity.blocks import Blocks
from flexmb.sensitivity.gate import Admitted
from flexmb.sensitivity.jump import EventError, Jumped, jumped
from flexmb.sensitivity.law_rates import LawRates, event_rates, law_rates
from flexmb.sensitivity.leg import Course, Variation, clock_of_leg
from flexmb.sensitivity.loops import Loops
from flexmb.sensitivity.part_scene import ChangeOfValue, PartNumber, PartScene
from flexmb.sensitivity.systems import Systems
from flexmb.typing import Real


class FollowedPart(NamedTuple):
    """A part of a run whose state and derivatives, `joined` in states (T,.), are known at times (T,) s.

    feedback: its controllers, whose outputs are read back at these times. before: the state at its end, before events.
    """

    leg: Leg
    variation: Variation
    feedback: Feedback | None
    times: Real
    states: Real
    before: Course
    is_last: bool


class Passage:
    """One run, whose parts are passed one after the other.

    after: what the last events did to the derivatives, None before the first.
    """

    def __init__(
        self, admitted: Admitted, numbers: Sequence[Number | None], scales: Real, settings: Settings, length: float
    ) -> None:
        """numbers (P,): those that are admitted, in any order, and None for other directions; length (s) of the run."""
        self._admitted, self._numbers, self._scales, self._settings = admitted, numbers, scales, settings
        self._scene, self._length = admitted.system.scene, length
        self._systems = Systems(scales, admitted.handed)
        self._levels = event_rates(self._scene, numbers, scales)
        self._changes: list[ChangeOfValue] = []
        self._of_part: list[PartNumber | None] = []
        self._laws: LawRates | None = None
        self._energy = np.zeros(len(numbers))
        self._system: Any = None
        self._blocks: Blocks | None = None
        self._start: Real = np.zeros((0, len(numbers)))
        self.after: Jumped | None = None

    def blocks(self, leg: Leg) -> Blocks:
        """The tables of a part of the run in dual numbers."""
        if leg.system is self._system and not (self.after is not None and self.after.changes):
            assert self._blocks is not None
            return self._blocks
        part = PartScene(self._scene, self._changes, leg.system.scene)
        self._of_part = [None if number is None else PartNumber(number, part) for number in self._numbers]
        self._laws = None
        if self.after is None:
            names = [None if number is None else number.name for number in self._numbers]
            chosen = [names.index(name) for name in self._admitted.tables.names]
            self._blocks, self._start = self._systems.first(self._admitted.tables, chosen)
        else:
            acting = [event if event is not None and part.is_mechanical(event) else None for event in self._of_part]
            anew = bool(self.after.changes)
            self._blocks = self._systems.then(leg.system, leg.begin.state, acting, self.after.held, anew)
        self._system = leg.system
        return self._blocks

    def followed(
        self, course: Sequence[Leg], wanted: Callable[[Leg, bool], Iterable[float]]
    ) -> Iterator[FollowedPart]:
        """The parts of a run with the derivatives of their states at their ends and at `wanted` times (s) of a part,
        which may be the last. Whoever takes one passes its end by `ended` before the next."""
        loops = None
        for i, leg in enumerate(course):
            blocks, start, stop = self.blocks(leg), leg.begin.state.t, leg.raw.t
            with integration(leg.system, "articulated", 0.0, self._settings.integrator) as solve:
                is_last = i + 1 == len(course)
                times = np.unique([start, *wanted(leg, is_last), stop])
                y, clock = clock_of_leg(solve, leg, times, self._settings)
                loops = self.loops(solve, loops, is_last and bool(i) and start == stop)
                variation = Variation(leg, blocks, loops)
                at = self.begun(variation, y)
                states = variation.joined(at)[None]
                if stop > start:
                    states = variation.integrate(at, clock.times, clock, self._settings)
                before = Course(leg.raw.y, variation.parted(states[-1]).Y)
                if loops is not None:
                    if is_last:
                        variation.put(float(clock.times[-1]), states[-1])  # controllers act at the end of the run
                    loops.replay()
                yield FollowedPart(leg, variation, solve.feedback, clock.times, states, before, is_last)

    def loops(self, solve: Integration, before: Loops | None, ends: bool) -> Loops | None:
        """The controllers of a part of the run, None without any; see `Loops`."""
        if solve.feedback is None:
            return None
        if self._laws is None:
            self._laws = law_rates(solve.system, self._of_part, self._scales)
        assert self._blocks is not None
        return Loops(solve.feedback, self._blocks, self._laws, before, ends)

    def begun(self, variation: Variation, y: Real) -> Course:
        """The state at the start of a part of the run, with its derivatives."""
        loops, t, after = variation.loops, variation.leg.begin.state.t, self.after
        if after is None:  # the run begins
            start = self._start
            if loops is None:
                return Course(y, start)
            variation.take(self._started(loops, y))  # with the initial states of controllers, which may begin elsewhere
            loops.begin(t)
            return self._started(loops, y)
        at = Course(y, after.D.copy())
        if np.any(after.dt) and loops is not None and loops.is_due(t):
            raise EventError(
                f'event "{after.crossings[0].event.name}" happens at t = {t:g} s, when a sampled controller acts: '
                "which comes first changes what follows, so that the run has no derivative beyond; move one of them"
            )
        if after.changes:  # the work includes the energy that changes of values bring
            at.Y[-1] += variation.energy_rates(t, at, after.dt) - self._energy
        if np.any(after.dt):
            at = Course(y, at.Y - np.outer(variation.slope(t, at).y, after.dt))
        return at

    def _started(self, loops: Loops, y: Real) -> Course:
        """The state at the start of the run with the states that controllers have."""
        states = loops.blocks.joined(list(loops.law[:, loops.continuous]))
        return Course(y, np.vstack([self._start[:-1], states, self._start[-1:]]))

    def ended(self, variation: Variation, end: Course) -> Jumped:
        """What the events at the end of a part of the run do to the derivatives there; kept as `after`."""
        leg, settings = variation.leg, self._settings
        tolerance = np.array([settings.atol, settings.rtol, self._length])
        variation_after = jumped(variation, end, self._levels, {} if self.after is None else self.after.held, tolerance)
        if variation_after.changes:
            self._changes += variation_after.changes
            self._energy = variation.energy_rates(leg.raw.t, Course(end.y, variation_after.D), variation_after.dt)
        self.after = variation_after
        return variation_after
