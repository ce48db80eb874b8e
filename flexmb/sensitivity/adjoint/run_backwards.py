"""A whole run backwards: its smooth parts, and between them what events and sampled controllers do, transposed.

The gradient that is carried backwards belongs to an extended state: the values at which events hold coordinates, y, and
the signals and states of sampled controllers. What is left on the way belongs to the parameters. Directions are in the
order of `StateDirections`. Events, instants of controllers, and channels at the instants of the scalar are
differentiated along all of them by the dual numbers of `flexmb.sensitivity.parts`: they are few, beside the stages of
steps.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.control import loop
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
from flexmb.sensitivity.gate import Admitted
from flexmb.sensitivity.leg import Course, Variation, clock_of_leg
from flexmb.sensitivity.parts import Passage
from flexmb.sensitivity.readings import ChannelRates, Left, ScalarReading
from flexmb.sensitivity.scalars import Probe
from flexmb.typing import Index, Real


class Adjoint:
    """The gradient of a scalar by many numbers.

    cost: of the steps, which is known after the call.
    """

    def __init__(self, admitted: Admitted, reading: ScalarReading, settings: Settings) -> None:
        self._admitted, self._reading, self._settings = admitted, reading, settings
        self._numbers = admitted.numbers
        self.cost = StepCost(0, 0, 0, 0)

    def __call__(self, course: Sequence[Leg]) -> Real:
        """The gradient (P,) of what is read in a run, whose parts between events are its course."""
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
        places, reading, t_end = self._places, self._reading, course[-1].raw.t
        numbers = [*self._numbers, *[None] * (places.size - len(self._numbers))]
        length = t_end - course[0].begin.state.t
        passage = Passage(self._admitted, numbers, np.ones(places.size), self._settings, length)
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
                own = reading.within(leg, is_last)
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
                seeing = ChannelRates(variation, reading.names, solve.feedback)
                if left is not None:  # before the controllers of this part act
                    jumps = np.subtract(left.integrands, reading.integrands(seeing, start, Course(y, places.along)))
                    part.moved = np.asarray(np.sum(jumps) * left.dt)
                self._see(part, seeing, sampling, own, due, dict(zip(ends, states, strict=True)))
                found.append(part)
                end = Course(leg.raw.y, places.along)
                after = passage.ended(variation, end)
                left = Left(after.dt, reading.integrands(seeing, stop, end)) if np.any(after.dt) else None
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
                seen = seeing.at(t, Course(states[t], self._places.along))
                part.added[t] = self._reading.added(probes[t], seen)

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
