"""Follows a finished run again with the derivatives of its state: from part to part, and across the events between."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexmb.integrate.settings import Settings
from flexmb.parameters.numbers import Number
from flexmb.run.driver import Leg
from flexmb.run.propagate import Integration, integration
from flexmb.run.trajectory import Trajectory
from flexmb.scene.schema import Scene
from flexmb.sensitivity.channels import Chosen, Seen, channels
from flexmb.sensitivity.jump import EventError, Jumped, jumped
from flexmb.sensitivity.law_rates import LawRates, event_rates, law_rates
from flexmb.sensitivity.leg import Course, Variation, clock_of_leg
from flexmb.sensitivity.loops import Loops
from flexmb.sensitivity.systems import Systems
from flexmb.typing import Real

# Derivatives are integrated as changes by this part of each number. The error of a step is held below rtol times them
# plus atol, so that what changes by less than atol if a number changes by 3 % does not shorten steps.
SHARE = 0.03

EventTimes = list[tuple[str, float, Real]]
"""Name, time (s), derivatives (P,) of the time of each event."""


class Following:
    """One run, followed with scaled derivatives: each is per SHARE of the `scale` of its number."""

    def __init__(
        self, scene: Scene, found: Sequence[Number], settings: Settings, trajectory: Trajectory, outputs: Chosen
    ) -> None:
        self._order = np.argsort([not _is_mechanical(scene, each) for each in found], kind="stable")
        self._numbers = [found[k] for k in self._order]
        self._scales = np.array([SHARE * each.scale for each in self._numbers])
        self._scene, self._settings, self._trajectory, self._outputs = scene, settings, trajectory, outputs
        mechanical = sum(_is_mechanical(scene, each) for each in found)
        self._systems = Systems(self._numbers, self._scales, mechanical)
        self._levels = event_rates(scene, self._numbers, self._scales)
        self._changes: list[tuple[str, Any]] = []
        self._alive = [True] * len(found)
        self._laws: LawRates | None = None
        P = len(found)
        self._derivatives = np.full((len(trajectory.t), len(outputs.names), P), np.nan)
        self._events: EventTimes = []
        self._energy = np.zeros(P)

    def __call__(self, course: Sequence[Leg]) -> tuple[Real, EventTimes]:
        """Derivatives (T,K,P) of the outputs, and those of the times of events."""
        blocks, start = self._systems.first(course[0].system)
        before, after = None, None
        system, loops = course[0].system, None
        for i, leg in enumerate(course):
            if leg.system is not system:
                assert after is not None
                blocks, system = self._systems.then(leg.system, leg.begin.state, self._alive, after.held), leg.system
                self._laws = None if after.changes else self._laws  # latches and releases leave controllers as they are
            with integration(leg.system, "articulated", 0.0, self._settings.integrator) as solve:
                is_last, stop = i + 1 == len(course), leg.raw.t
                times = self._times(leg, is_last)
                y, clock = clock_of_leg(
                    solve, leg, np.unique([leg.begin.state.t, *self._trajectory.t[times], stop]), self._settings
                )
                loops = self._loops(solve, blocks, loops, is_last and bool(i) and leg.begin.state.t == stop)
                variation = Variation(leg, blocks, loops)
                at = self._begun(variation, y, start, before, after)
                states = (
                    variation.integrate(at, clock.times, clock, self._settings) if stop > leg.begin.state.t else [at]
                )
                before = Course(leg.raw.y, states[-1].Y)
                self._see(variation, solve, clock.times, states, times, is_last)
                after = self._jumped(variation, before, {} if after is None else after.held)
                start = after.D
        order = np.argsort(self._order)
        scaled = self._derivatives / self._scales
        return scaled[..., order], [(name, t, (dt / self._scales)[order]) for name, t, dt in self._events]

    def _times(self, leg: Leg, is_last: bool) -> slice:
        """The numbers of the output times of a part of the run."""
        t, start, stop = self._trajectory.t, leg.begin.state.t, leg.raw.t
        first = int(np.searchsorted(t, start, side="left"))
        if is_last and start == stop:
            return slice(len(t) - 1, len(t))
        last = int(np.searchsorted(t, stop, side="right" if is_last else "left"))
        return slice(first, last)

    def _loops(self, solve: Integration, blocks: Any, before: Loops | None, ends: bool) -> Loops | None:
        if solve.feedback is None:
            return None
        if self._laws is None:
            alive = [each if self._alive[k] else None for k, each in enumerate(self._numbers)]
            self._laws = law_rates(solve.system, alive, self._scales)
        return Loops(solve.feedback, blocks, self._laws, before, ends)

    def _begun(self, variation: Variation, y: Real, start: Real, before: Course | None, after: Jumped | None) -> Course:
        """The state at the start of a part of the run, with its derivatives."""
        loops, t = variation.loops, variation.leg.begin.state.t
        if before is None or after is None:  # the run begins
            if loops is None:
                return Course(y, start)
            P = start.shape[1]
            states = np.zeros((len(loops.continuous), P))
            whole = Course(y, np.vstack([start[:-1], states, start[-1:]]))
            variation.take(whole)
            loops.begin(t)
            states[:] = loops.blocks.joined(list(loops.law[:, loops.continuous]))
            return Course(y, np.vstack([start[:-1], states, start[-1:]]))
        at = Course(y, after.D.copy())
        if np.any(after.dt) and loops is not None and loops.is_due(t):
            raise EventError(
                f'event "{after.crossings[0].event.name}" happens at t = {t:g} s, when a sampled controller acts: '
                "which comes first changes what follows, so that the run has no derivative beyond; move one of them"
            )
        if after.changes:  # the work includes the energy that changes of values bring
            at.Y[-1] += variation.energy_rates(t, at) - self._energy
        if np.any(after.dt):
            at = Course(y, at.Y - np.outer(variation.slope(t, at).y, after.dt))
        return at

    def _jumped(self, variation: Variation, end: Course, held: dict[str, Real]) -> Jumped:
        leg, settings = variation.leg, self._settings
        length = float(self._trajectory.t[-1] - self._trajectory.t[0])
        tolerance = np.array([settings.atol, settings.rtol, length])
        found = jumped(variation, end, self._levels, held, tolerance)
        self._events += [(each.event.name, leg.raw.t, each.dt) for each in found.crossings]
        if found.changes:
            self._changes += found.changes
            self._alive = [self._matters(each) for each in self._numbers]
            self._energy = variation.energy_rates(leg.raw.t, Course(end.y, found.D))
        return found

    def _matters(self, number: Number) -> bool:
        """Whether the scene after the changes so far depends on a number."""
        other = number.scene_at(number.value + 2.0**-6 * number.scale)
        return bool(_changed(other, self._changes) != _changed(self._scene, self._changes))

    def _see(
        self,
        variation: Variation,
        solve: Integration,
        times: Real,
        states: Sequence[Course],
        wanted: slice,
        is_last: bool,
    ) -> None:
        """Derivatives of the outputs at the output times of a part of the run."""
        loops, system = variation.loops, variation.blocks.system
        names = {} if solve.feedback is None else solve.feedback.names
        known = channels(system, names)
        if loops is not None:
            if is_last:
                variation.put(float(times[-1]), states[-1])  # controllers act at the end of the run
            loops.replay()
        signals = any(name.startswith("signal.") for name in self._outputs.names)
        for sample in range(wanted.start, wanted.stop):
            t = float(self._trajectory.t[sample])
            state = states[int(np.searchsorted(times, t))]
            observed = of_signals = None
            if self._outputs.observed:
                variation.put(t, state)
                observed = variation.blocks.observe()
            if signals and loops is not None:
                variation.take(state)
                of_signals = loops.look(t)[1]
            seen = Seen(state.Y, observed, of_signals)
            for k, name in enumerate(self._outputs.names):
                if name in known:
                    self._derivatives[sample, k] = known[name](seen)
                elif ".drive[" in name:  # of a coordinate that is free here
                    self._derivatives[sample, k] = 0.0


def _changed(scene: Scene, changes: Sequence[tuple[str, Any]]) -> Scene:
    for path, value in changes:
        scene = scene.with_values({path: value})
    return scene


def _is_mechanical(scene: Scene, number: Number) -> bool:
    """Whether the tables of the mechanics may depend on a number."""
    other = number.scene_at(number.value + 2.0**-6 * number.scale)
    steady = {"controllers", "events", "sensors"}
    return any(getattr(other, key) != getattr(scene, key) for key in scene.__struct_fields__ if key not in steady)
