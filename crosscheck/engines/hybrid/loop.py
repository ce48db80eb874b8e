"""The loop: arcs between instants, crossings of what events watch, actions, samples and delayed outputs.

An *instant* is a time known before the run: a break of a function of time, an event on time, a sample, a change of a
delayed output. Between two of them the scene is an ordinary differential equation; a crossing within an arc ends it.
At an instant events come first, in the order of the scene, then outputs that were delayed, then samples.

A *phase* is the scene between two events that change it: a coordinate that is latched is one that is prescribed to be
constant, so that a peer compiles each phase as it compiles any scene.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, assert_never

import numpy as np
from scipy.optimize import brentq

from crosscheck.engines.contract import Effort
from crosscheck.engines.functions_of_time import breaks_between
from crosscheck.engines.hybrid.laws import NONE, Numbers
from crosscheck.engines.hybrid.phase import Compile, ControllerOutputs, Phase, PhaseSample
from crosscheck.engines.hybrid.reading import TIME, coordinate_names, rate_names, slot_of
from crosscheck.engines.hybrid.stepping import ArcStep, ArcStepper, Stopped
from crosscheck.engines.links import Link, Scalar, links
from crosscheck.engines.rigid_tree import Slot, TreeState
from flexmb.scene.functions import Constant, Function
from flexmb.scene.schema import (
    Action,
    Change,
    Controller,
    Dock,
    EndRun,
    Impact,
    Latch,
    Release,
    Scene,
    SceneEvent,
    Separate,
)
from flexmb.typing import Real

# Links whose coordinates events hold or let go: what is held is prescribed to be constant, its motor off.


def _is_of(link: Link, slot: Slot) -> bool:
    return (link.kind, link.joint) == (slot.link.kind, slot.link.joint)


def _scalar(chain: tuple[Link, ...], slot: Slot) -> Scalar:
    """The only scalar freedom of the link of a slot."""
    (scalar,) = (each for link in chain if _is_of(link, slot) for each in link.freedoms if isinstance(each, Scalar))
    return scalar


def _with_scalar(chain: tuple[Link, ...], slot: Slot, **changes: Function | None) -> tuple[Link, ...]:
    """Links with changes of that freedom."""
    changed: Any = replace(_scalar(chain, slot), **changes)  # type: ignore[arg-type]  # of its two functions
    return tuple(
        replace(link, freedoms=tuple(changed if isinstance(each, Scalar) else each for each in link.freedoms))
        if _is_of(link, slot)
        else link
        for link in chain
    )


def driven(chain: tuple[Link, ...], slot: Slot, motion: Function) -> tuple[Link, ...]:
    """Links with a coordinate that follows a function of time, its motor off."""
    return _with_scalar(chain, slot, prescribed=motion, effort=None)


def freed(chain: tuple[Link, ...], slot: Slot, given: tuple[Link, ...]) -> tuple[Link, ...]:
    """Links with a coordinate that is free, with the motor that it is given."""
    return _with_scalar(chain, slot, prescribed=None, effort=_scalar(given, slot).effort)


def as_held(chain: tuple[Link, ...], fresh: tuple[Link, ...], held: Sequence[Slot]) -> tuple[Link, ...]:
    """Fresh links, in which what is held stays held."""
    for slot in held:
        motion = _scalar(chain, slot).prescribed
        assert motion is not None
        fresh = driven(fresh, slot, motion)
    return fresh


NO_EVENTS: tuple[str, ...] = ()
SAME = 1e-12
"""Times that differ by less, of the larger end time of the run, are one instant."""
RESTING = 1e-12
"""A watched quantity nearer to its level than this, of one or of the level, is at it."""
MOST_AT_ONCE = 50
"""Events that follow each other without a step between them, after which a run is given up."""


class HybridMotion:
    """One run. The state is [y of the mechanics less its work; states of continuous controllers; work]."""

    def __init__(self, scene: Scene, compiled: Compile, times: Real, effort: Effort) -> None:
        self._compiled, self._times = compiled, times
        self._t0, self._t1 = float(times[0]), float(times[-1])
        self._same = SAME * max(abs(self._t0), abs(self._t1))
        self._stepper = ArcStepper(effort)
        self._outputs = ControllerOutputs()
        self._motors = links(scene)
        self._phase = Phase(scene, self._motors, self._outputs, compiled)
        self._sampled = [law for law in scene.controllers if law.period_s is not None]
        self._continuous = [law for law in scene.controllers if law.period_s is None]
        self._next = {law.name: self._first(law) for law in self._sampled}
        self._waiting: list[tuple[float, str, Numbers]] = []
        self._x: dict[str, Real] = {}
        self._sides: dict[str, float] = {}
        self._due = {event.name for event in scene.events if event.watch == TIME and event.level >= self._t0}
        self._held: set[str] = set()
        self._let_go: set[str] = set()
        self._at_once = 0
        self.t, self.y = self._t0, self._phase.mechanics.initial()
        self.samples: list[PhaseSample] = []
        self.happened: list[tuple[str, float]] = []
        self.evaluations = self.steps = 0

    def begin(self) -> None:
        """What is due at the start, from outputs of zero."""
        scene, state = self._phase.scene, self._phase.mechanics.state(self.t, self.y)
        for law in scene.controllers:
            u = self._phase.inputs_of(law, self.t, state)
            self._x[law.name] = self._phase.laws[law.name].start(u)
            put_out = self._phase.laws[law.name].outputs(u, self._x[law.name])
            self._outputs.now[law.name] = put_out if law.period_s is None else [0.0] * len(put_out)
        self._started = {law.name for law in self._continuous}
        self._instant(())

    def run(self) -> None:
        """Fills `samples` and `happened`; raises `Stopped` where it cannot go on."""
        self.begin()
        self._keep(self._t0 + self._same)
        while self.t < self._t1 - self._same:
            end, crossed = self._next_instant(), NO_EVENTS
            while self.t < end and not crossed:
                crossed = self._arc(end)
            self._instant(crossed)
            self._keep(self.t + self._same)

    def sample(self, t: float) -> PhaseSample:
        """The state for the output."""
        return self._sampled_state(t, self._joined())

    def _keep(self, until: float) -> None:
        """The present state at all samples that are due."""
        while len(self.samples) < len(self._times) and self._times[len(self.samples)] <= until:
            self.samples.append(self.sample(float(self._times[len(self.samples)])))

    # Instants

    def _first(self, law: Controller) -> int:
        """The number of the first sample of a controller."""
        assert law.period_s is not None
        return max(0, int(np.ceil((self._t0 - law.offset_s - self._same) / law.period_s)))

    def _sample_time(self, law: Controller) -> float:
        assert law.period_s is not None
        return law.offset_s + self._next[law.name] * law.period_s

    def _next_instant(self) -> float:
        """The next time (s) at which something may jump; the end of the run, if nothing does before."""
        scene, now = self._phase.scene, self.t + self._same
        later = [self._t1, *breaks_between(self._phase.functions, now, self._t1)]
        later += [event.level for event in scene.events if event.name in self._due]
        later += [self._sample_time(law) for law in self._sampled]
        later += [t for t, _, _ in self._waiting]
        if not self._stepper.has_dense_output and len(self.samples) < len(self._times):
            later.append(float(self._times[len(self.samples)]))
        return min(t for t in later if t > now)

    def _instant(self, crossed: Sequence[str]) -> None:
        """What is due now: events, those crossed among them, then delayed outputs, then samples."""
        at = self.t + self._same
        for event in self._phase.scene.events:
            if event.name in crossed or (event.name in self._due and event.level <= at):
                self._due.discard(event.name)
                self._happen(event)
        waiting, self._waiting = self._waiting, []
        for t, name, put_out in waiting:
            if t <= at:
                self._outputs.now[name] = put_out
            else:
                self._waiting.append((t, name, put_out))
        for law in self._sampled:
            if self._sample_time(law) <= at:
                self._sample(law)
        self._settle(crossed)

    def _sample(self, law: Controller) -> None:
        """A sampled controller reads, puts out and changes its states."""
        state = self._phase.mechanics.state(self.t, self.y)
        self._put_out_continuously(self.t, state)
        u, written = self._phase.inputs_of(law, self.t, state), self._phase.laws[law.name]
        if law.name not in self._started:
            self._started.add(law.name)
            self._x[law.name] = written.start(u)
        x = self._x[law.name]
        put_out, self._x[law.name] = written.outputs(u, x), written.change(u, x)
        if law.delay_s > 0.0:
            self._waiting.append((self._sample_time(law) + law.delay_s, law.name, put_out))
        else:
            self._outputs.now[law.name] = put_out
        self._next[law.name] += 1

    # Events

    def _settle(self, crossed: Sequence[str]) -> None:
        """On which sides of their levels the watched quantities are: 0 where they are at it, and have yet to leave."""
        self._sides = {}
        for event in self._watched():
            gap = self._phase.gap(event, self.t, self.y)
            self._sides[event.name] = 0.0 if event.name in crossed else _side(event, gap)

    def _watched(self) -> list[SceneEvent]:
        """Events that may happen: not on time, and not on a coordinate that is held, or its rate."""
        events = (event for event in self._phase.scene.events if event.watch != TIME)
        return [event for event in events if self._coordinate(event) not in self._held]

    def _coordinate(self, event: SceneEvent) -> str:
        """The coordinate that is watched, or whose rate is; "" for a signal."""
        scene = self._phase.scene
        return event.watch if event.watch in coordinate_names(scene) else rate_names(scene).get(event.watch, "")

    def _happen(self, event: SceneEvent) -> None:
        self.happened.append((event.name, self.t))
        self._at_once += 1
        if self._at_once > MOST_AT_ONCE:
            raise Stopped(f'stopped at t = {self.t:g} s: "{event.name}" happens again and again')
        self._at_level(event)
        before = self._energy()
        for action in event.actions:
            self._act(action)
        self.y[-1] += self._energy() - before

    def _at_level(self, event: SceneEvent) -> None:
        """A watched coordinate or rate is set to its level: the root of its interpolant is near it."""
        coordinate = self._coordinate(event)
        if coordinate and coordinate not in self._held:
            state, slot = self._phase.mechanics.state(self.t, self.y), self._slot(coordinate)
            q, v = state.q.copy(), state.v.copy()
            if event.watch == coordinate:
                q[slot.q] = event.level
            else:
                v[slot.v] = event.level
            self._restart(q, v)

    def _act(self, action: Action) -> None:
        phase = self._phase
        match action:
            case Latch(coordinate=name):
                self._strike(name, 0.0)
                state, slot = phase.mechanics.state(self.t, self.y), self._slot(name)
                self._held.add(name)
                self._let_go.discard(name)
                self._change(phase.scene, driven(phase.chain, slot, Constant(value=float(state.q[slot.q]))))
            case Release(coordinate=name):
                self._held.discard(name)
                self._let_go.add(name)
                self._change(phase.scene, freed(phase.chain, self._slot(name), self._motors))
            case Impact(coordinate=name, restitution=restitution):
                state, slot = phase.mechanics.state(self.t, self.y), self._slot(name)
                self._strike(name, -restitution * float(state.v[slot.v]))
            case Change(path=path, value=value):
                scene = phase.scene.with_values({path: value})
                self._motors = chain = links(scene)
                for each in self._let_go:
                    chain = freed(chain, self._slot(each), chain)
                self._change(scene, as_held(phase.chain, chain, [self._slot(each) for each in self._held]))
            case EndRun() | Separate() | Dock():
                raise NotImplementedError(f"{action}, which `refusal` refuses, has reached the loop")
            case _:
                assert_never(action)

    def _strike(self, name: str, rate: float) -> None:
        """An impulse along a coordinate gives it a rate; those of all other free speeds are zero.

        M (v+ - v-) vanishes but for the coordinate and for driven ones, whose speeds stay as they are.
        """
        mechanics, struck = self._phase.mechanics, self._slot(name)
        state = mechanics.state(self.t, self.y)
        M, v = mechanics.masses(state.q), state.v.copy()
        kept = [slot.v for slot in mechanics.slots if slot.driven]
        rest = np.setdiff1d(np.arange(len(v)), [*kept, struck.v])
        change = rate - v[struck.v]
        v[struck.v] = rate
        v[rest] -= np.linalg.solve(M[np.ix_(rest, rest)], M[rest, struck.v] * change)
        self._restart(state.q, v)

    def _change(self, scene: Scene, chain: tuple[Link, ...]) -> None:
        """Go on with another scene, at the same coordinates and speeds."""
        state = self._phase.mechanics.state(self.t, self.y)
        self._phase = Phase(scene, chain, self._outputs, self._compiled)
        self._restart(state.q, state.v)

    def _restart(self, q: Real, v: Real) -> None:
        work = self.y[-1]
        self.y = self._phase.mechanics.packed(q, v)
        self.y[-1] = work

    def _slot(self, coordinate: str) -> Slot:
        return slot_of(self._phase.scene, self._phase.mechanics.slots, coordinate)

    def _energy(self) -> float:
        mechanics = self._phase.mechanics
        return sum(mechanics.observe(self.t, mechanics.state(self.t, self.y)).energy.values())

    # Arcs

    def _arc(self, end: float) -> tuple[str, ...]:
        """Integrate to the end, or to the first crossing: the names of the events that it makes happen."""
        rate = self._rate
        for step in self._stepper.steps(rate, self.t, self._joined(), end):
            self.steps += 1
            crossed, until = self._crossings(step)
            last = until if crossed else step.end
            while len(self.samples) < len(self._times) and self._times[len(self.samples)] < last - self._same:
                t = float(self._times[len(self.samples)])
                self.samples.append(self._sampled_state(t, step.at(t)))
            self._split(step.y if last == step.end else step.at(last))
            if last - self.t > self._same:
                self._at_once = 0
            self.t = last
            if crossed:
                return crossed
        return ()

    def _crossings(self, step: ArcStep) -> tuple[tuple[str, ...], float]:
        """Events whose quantities first reach their levels within a step, and when; none and the end of the step."""
        found: list[tuple[float, str]] = []
        for event in self._watched():
            side, before = self._sides[event.name], step.begin
            for probe in step.probes:
                t = step.begin + probe * (step.end - step.begin) if probe < 1.0 else step.end
                gap = self._gap(event, t, step.y if probe == 1.0 else step.at(t))
                now = _side(event, gap)
                towards = "rising" if side < 0.0 else "falling"
                if side and now != side and event.crossing in ("either", towards):
                    found.append((self._root(event, step, before, t) if now else t, event.name))
                    break
                side, before = now or side, t
            else:
                self._sides[event.name] = side
        if not found:
            return (), step.end
        first = min(found)[0]
        return tuple(name for t, name in found if t <= first + self._same), first

    def _root(self, event: SceneEvent, step: ArcStep, before: float, after: float) -> float:
        gaps = [self._gap(event, t, step.at(t)) for t in (before, after)]
        if gaps[0] * gaps[1] >= 0.0:  # rounding has taken one of them over the level
            return before if abs(gaps[0]) < abs(gaps[1]) else after
        return float(brentq(lambda t: self._gap(event, t, step.at(t)), before, after, xtol=1e-15, rtol=1e-15))

    def _gap(self, event: SceneEvent, t: float, joined: Real) -> float:
        return self._phase.gap(event, t, self._of_mechanics(joined))

    def _rate(self, t: float, joined: Real) -> Real:
        self.evaluations += 1
        mechanics, y = self._phase.mechanics, self._of_mechanics(joined)
        if not self._continuous:
            return mechanics.rate(t, y)
        self._x |= self._states(joined)
        change = self._put_out_continuously(t, mechanics.state(t, y))
        rate = mechanics.rate(t, y)
        return np.concatenate([rate[:-1], change, rate[-1:]])

    def _put_out_continuously(self, t: float, state: TreeState) -> Real:
        """What continuous controllers put out at a state; the rates of their states."""
        changes = [NONE]
        for law in self._continuous:
            u, written, x = self._phase.inputs_of(law, t, state), self._phase.laws[law.name], self._x[law.name]
            self._outputs.now[law.name] = written.outputs(u, x)
            changes.append(written.change(u, x))
        return np.concatenate(changes)

    def _joined(self) -> Real:
        if not self._continuous:
            return self.y
        own = [self._x[law.name] for law in self._continuous]
        return np.concatenate([self.y[:-1], *own, self.y[-1:]])

    def _of_mechanics(self, joined: Real) -> Real:
        if not self._continuous:
            return joined
        return np.concatenate([joined[: self._count], joined[-1:]])

    @property
    def _count(self) -> int:
        """Numbers of the state of the mechanics, less the work."""
        return len(self.y) - 1

    def _states(self, joined: Real) -> dict[str, Real]:
        """Of continuous controllers, from the state of all."""
        states, first = {}, self._count
        for law in self._continuous:
            states[law.name] = joined[first : first + len(self._x[law.name])]
            first += len(self._x[law.name])
        return states

    def _split(self, joined: Real) -> None:
        self._x |= self._states(joined)
        self.y = self._of_mechanics(joined).copy()

    def _sampled_state(self, t: float, joined: Real) -> PhaseSample:
        y, own = self._of_mechanics(joined).copy(), self._x
        self._x = own | self._states(joined)
        self._put_out_continuously(t, self._phase.mechanics.state(t, y))
        self._x = own
        return PhaseSample(self._phase, t, y, dict(self._outputs.now))


def _side(event: SceneEvent, gap: float) -> float:
    """The sign of what is watched less its level, 0 at it."""
    return 0.0 if abs(gap) <= RESTING * max(1.0, abs(event.level)) else float(np.sign(gap))
