"""From one part of a run to the next with derivatives along directions: the tables of each part, and its events.

Directions belong to numbers of the scene, or to none: those of `flexmb.sensitivity.adjoint` change the state itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexmb.integrate.settings import Settings
from flexmb.parameters.numbers import Number
from flexmb.run.driver import Leg
from flexmb.run.propagate import Integration
from flexmb.scene.schema import Scene
from flexmb.sensitivity.blocks import Blocks
from flexmb.sensitivity.jump import EventError, Jumped, jumped
from flexmb.sensitivity.law_rates import LawRates, event_rates, law_rates
from flexmb.sensitivity.leg import Course, Variation
from flexmb.sensitivity.loops import Loops
from flexmb.sensitivity.systems import Systems
from flexmb.typing import Real


class Passage:
    """One run, whose parts are passed one after the other.

    after: what the last events did to the derivatives, None before the first.
    """

    def __init__(
        self, scene: Scene, numbers: Sequence[Number | None], scales: Real, settings: Settings, length: float
    ) -> None:
        """numbers (P,): those that the tables of the mechanics may depend on come first; length (s) of the run."""
        self._scene, self._numbers, self._scales, self._settings = scene, numbers, scales, settings
        self._length = length
        mechanical = sum(each is not None and is_mechanical(scene, each) for each in numbers)
        self._systems = Systems(numbers, scales, mechanical)
        self._levels = event_rates(scene, numbers, scales)
        self._changes: list[tuple[str, Any]] = []
        self._alive = [True] * len(numbers)
        self._laws: LawRates | None = None
        self._energy = np.zeros(len(numbers))
        self._system: Any = None
        self._blocks: Blocks | None = None
        self._start: Real = np.zeros((0, len(numbers)))
        self.after: Jumped | None = None

    def blocks(self, leg: Leg) -> Blocks:
        """The tables of a part of the run in dual numbers."""
        if self._system is None:
            self._blocks, self._start = self._systems.first(leg.system)
        elif leg.system is not self._system:
            assert self.after is not None
            self._blocks = self._systems.then(leg.system, leg.begin.state, self._alive, self.after.held)
            if self.after.changes:  # latches and releases leave controllers as they are
                self._laws = None
        self._system = leg.system
        assert self._blocks is not None
        return self._blocks

    def loops(self, solve: Integration, before: Loops | None, ends: bool) -> Loops | None:
        """The controllers of a part of the run, None without any; see `Loops`."""
        if solve.feedback is None:
            return None
        if self._laws is None:
            alive = [each if self._alive[k] else None for k, each in enumerate(self._numbers)]
            self._laws = law_rates(solve.system, alive, self._scales)
        assert self._blocks is not None
        return Loops(solve.feedback, self._blocks, self._laws, before, ends)

    def begun(self, variation: Variation, y: Real) -> Course:
        """The state at the start of a part of the run, with its derivatives."""
        loops, t, after = variation.loops, variation.leg.begin.state.t, self.after
        if after is None:  # the run begins
            start = self._start
            if loops is None:
                return Course(y, start)
            states = np.zeros((len(loops.continuous), start.shape[1]))
            variation.take(Course(y, np.vstack([start[:-1], states, start[-1:]])))
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

    def ended(self, variation: Variation, end: Course) -> Jumped:
        """What the events at the end of a part of the run do to the derivatives there; kept as `after`."""
        leg, settings = variation.leg, self._settings
        tolerance = np.array([settings.atol, settings.rtol, self._length])
        found = jumped(variation, end, self._levels, {} if self.after is None else self.after.held, tolerance)
        if found.changes:
            self._changes += found.changes
            self._alive = [self._matters(each) for each in self._numbers]
            self._energy = variation.energy_rates(leg.raw.t, Course(end.y, found.D))
        self.after = found
        return found

    def _matters(self, number: Number | None) -> bool:
        """Whether the scene after the changes so far depends on a number; True for a direction without one."""
        if number is None:
            return True
        other = number.scene_at(number.value + 2.0**-6 * number.scale)
        return bool(_changed(other, self._changes) != _changed(self._scene, self._changes))


def _changed(scene: Scene, changes: Sequence[tuple[str, Any]]) -> Scene:
    for path, value in changes:
        scene = scene.with_values({path: value})
    return scene


def is_mechanical(scene: Scene, number: Number) -> bool:
    """Whether the tables of the mechanics may depend on a number."""
    other = number.scene_at(number.value + 2.0**-6 * number.scale)
    steady = {"controllers", "events", "sensors"}
    return any(getattr(other, key) != getattr(scene, key) for key in scene.__struct_fields__ if key not in steady)
