"""A whole run backwards: its smooth parts, and between them what events do, transposed.

The gradient that is carried backwards belongs to an extended state: [y; the values at which events hold coordinates],
and what it leaves at each part belongs to the parameters. Directions are in the order

    parameters, first those on which the tables of the mechanics may depend    held coordinates    entries of y

Events, and channels at the instants of the scalar, are differentiated along all of these by the dual numbers of
`flexmb.sensitivity.passage`: they are few, beside the steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexmb.integrate.problem import Clock
from flexmb.integrate.settings import Settings
from flexmb.parameters.numbers import Number
from flexmb.run.driver import Leg
from flexmb.run.propagate import integration
from flexmb.scene.events import Latch
from flexmb.scene.schema import Scene
from flexmb.sensitivity.adjoint.arc import Arc, Cost
from flexmb.sensitivity.adjoint.seeing import Seeing
from flexmb.sensitivity.adjoint.transposes import Transposes
from flexmb.sensitivity.leg import Course, Variation, clock_of_leg
from flexmb.sensitivity.passage import Passage, is_mechanical
from flexmb.sensitivity.scalars import Probe, ScalarTerm, TimeIntegral
from flexmb.typing import Real


class Part(NamedTuple):
    """One part of a run, passed forwards.

    arc: its steps, None where it has no duration. added: gradients (D,) of the scalar by all directions, by instant (s).
    start (n,D): how the state at its start (s) changes along the directions of the part before; held: likewise values
    at which coordinates are held; moved (D,): how the scalar changes with the instant between both.
    """

    variation: Variation
    arc: Arc | None
    added: dict[float, Real]
    begin: float
    start: Real
    held: dict[str, Real]
    moved: Real


class Left(NamedTuple):
    """What is known at the end of a part: its view of the channels, how its end moves (D,), and the integrands there."""

    seeing: Seeing
    dt: Real
    integrands: list[float]


class Adjoint:
    """The gradient of a scalar by many numbers.

    value: of the scalar; cost: of the steps; both are known after the call.
    """

    def __init__(self, scene: Scene, found: Sequence[Number], terms: Sequence[ScalarTerm], settings: Settings) -> None:
        self._order = np.argsort([not is_mechanical(scene, each) for each in found], kind="stable")
        self._numbers, self._terms = [found[k] for k in self._order], terms
        self._scene, self._settings = scene, settings
        latches = [action for event in scene.events for action in event.actions if isinstance(action, Latch)]
        self._slots = list(dict.fromkeys(each.coordinate for each in latches))
        self._parameters = len(found)
        self._lanes = len(found) + len(self._slots)
        self.value = 0.0
        self.cost = Cost(0, 0, 0, 0)

    def __call__(self, course: Sequence[Leg]) -> Real:
        """The gradient (P,)."""
        return self._backwards(self._forwards(course))[np.argsort(self._order)]

    def _forwards(self, course: Sequence[Leg]) -> list[Part]:
        """Record all parts, with what the scalar adds in them and what events do."""
        n, begin, t_end = len(course[0].begin.y), course[0].begin.state.t, course[-1].raw.t
        along = np.zeros((n, self._lanes + n))
        along[:, self._lanes :] = np.eye(n)
        numbers = [*self._numbers, *[None] * (along.shape[1] - self._parameters)]
        passage = Passage(self._scene, numbers, np.ones(along.shape[1]), self._settings, t_end - begin)
        probes, names = self._probes(course, t_end), [name for term in self._terms for name in term.channels]
        found, left = list[Part](), None
        for i, leg in enumerate(course):
            held = {} if passage.after is None else passage.after.held
            if passage.after is not None:
                passage.after = passage.after._replace(held={name: self._unit(name, along.shape[1]) for name in held})
            variation = Variation(leg, passage.blocks(leg), None)
            start, stop, is_last = leg.begin.state.t, leg.raw.t, i + 1 == len(course)
            y, clock = self._begun(leg)
            at = passage.begun(variation, y)
            own = {t: each for t, each in probes.items() if start <= t and (t < stop or is_last)}
            arc = self._recorded(leg, y, clock, sorted({start, *own, stop}))
            seeing = Seeing(variation, along, names)
            moved = np.zeros(along.shape[1]) if left is None else self._across(left, seeing, start, y)
            times = sorted(own)
            states = [y] * len(times) if arc is None else arc.states_at(times)
            added = {t: self._added(seeing, t, state, own[t]) for t, state in zip(times, states, strict=True)}
            found.append(Part(variation, arc, added, start, at.Y, held, moved))
            after = passage.ended(variation, Course(leg.raw.y, along))
            left = Left(seeing, after.dt, self._integrands(seeing, stop, leg.raw.y)) if np.any(after.dt) else None
        return found

    def _backwards(self, parts: Sequence[Part]) -> Real:
        """The gradient (P,), from the last part to the first."""
        D = parts[0].start.shape[1]
        gradient = np.zeros(D)
        for part in reversed(parts):
            if part.arc is not None:
                variation, added = part.variation, [gradient, *part.added.values()]
                of_power = any(each[-1] != 0.0 for each in added)
                own = Transposes(variation.leg.system, variation.blocks, self._lanes, of_power)

                def at(t: float, part: Part = part) -> Real | None:
                    return part.added.get(t)

                state, rest = part.arc.backwards(gradient[self._lanes :], own, at)
                self.cost = self.cost.plus(part.arc.cost)
                gradient[: self._lanes] += rest[: self._lanes] + own.by_parameters()
                gradient[self._lanes :] = state
            gradient += part.added.get(part.begin, 0.0)
            gradient = self._through(part, gradient)
        return gradient[: self._parameters]

    def _through(self, part: Part, gradient: Real) -> Real:
        """The gradient (D,) before the events at the start of a part, from that after them."""
        before = part.start.T @ gradient[self._lanes :] + part.moved
        before[: self._parameters] += gradient[: self._parameters]
        for name, rates in part.held.items():
            before += gradient[self._parameters + self._slots.index(name)] * rates
        return np.asarray(before)

    def _unit(self, name: str, directions: int) -> Real:
        found = np.zeros(directions)
        found[self._parameters + self._slots.index(name)] = 1.0
        return found

    def _begun(self, leg: Leg) -> tuple[Real, Clock]:
        start = leg.begin.state.t
        with integration(leg.system, "articulated", 0.0, self._settings.integrator) as solve:
            return clock_of_leg(solve, leg, np.array([start, max(leg.raw.t, start)]), self._settings)

    def _recorded(self, leg: Leg, y: Real, clock: Clock, ends: Sequence[float]) -> Arc | None:
        if not leg.raw.t > leg.begin.state.t:
            return None
        return Arc(leg.system, y, clock, ends, self._settings)

    def _probes(self, course: Sequence[Leg], t_end: float) -> dict[float, list[Probe]]:
        """The instants of all terms, by time."""
        ends, found = [leg.raw.t for leg in course], dict[float, list[Probe]]()
        for term in self._terms:
            for probe in term.probes(t_end, ends):
                found.setdefault(probe.t, []).append(probe)
        return found

    def _added(self, seeing: Seeing, t: float, y: Real, probes: Sequence[Probe]) -> Real:
        """The gradient (D,) that the scalar adds at one instant; its value there is added to `value`."""
        values, rates = seeing.at(t, y)
        total = np.zeros(rates[probes[0].channel].shape)
        for each in probes:
            self.value += each.value(values[each.channel])
            total += each.slope(values[each.channel]) * rates[each.channel]
        return total

    def _integrands(self, seeing: Seeing, t: float, y: Real) -> list[float]:
        """The values of all integrands."""
        integrals = [term for term in self._terms if isinstance(term, TimeIntegral)]
        values = seeing.at(t, y)[0] if integrals else {}
        return [term.at(t).value(values[term.channel]) for term in integrals]

    def _across(self, left: Left, seeing: Seeing, t: float, y: Real) -> Real:
        """How integrals change with the instant at which one part ends and the next begins, (D,)."""
        jumps = np.subtract(left.integrands, self._integrands(seeing, t, y))
        return np.asarray(np.sum(jumps) * left.dt)
