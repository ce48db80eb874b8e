"""Segments of a run: each is integrated in compiled code from its start to the next event or the end of the run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import ACCEPTED, REJECTED
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import Watch
from flexmb.run.event_sides import Sides
from flexmb.run.origin import Beginning
from flexmb.run.propagate import Raw, integrate
from flexmb.run.trajectory import Trajectory
from flexmb.run.within_leaps import placed, too_near
from flexmb.scene.events import EndRun
from flexmb.scene.schema import SceneEvent
from flexmb.tables.status import Status
from flexmb.typing import Flags, Real


class SegmentEnd(Enum):
    """Why a segment ended."""

    TIME = auto()
    """The run's time is over, and no event is due there."""
    EVENT = auto()
    """A quantity reached the level of an event, or an event on time is due."""
    SAMPLE = auto()
    """The run's time is over, and an output that a sampled controller sets there reaches the level of an event."""
    LEAP = auto()
    """Events that happened before their instant, which lies within a leap, are watched again from here."""
    FAILURE = auto()
    """The run cannot continue: its status says why, or it was interrupted."""


class Segment(NamedTuple):
    """The part of a run between two instants at which something happens.

    raw: the integrator's result. levels: the quantities that were watched. part: outputs. found: the events at its end,
    which happen `early` (s) before their instant.
    """

    end: SegmentEnd
    raw: Raw
    levels: Watch | None
    part: Trajectory
    found: Sequence[SceneEvent]
    early: float = 0.0


class Segments:
    """Integrates the system of a run segment by segment, and evaluates the outputs of the run."""

    def __init__(self, sides: Sides, times: Real) -> None:
        """times (T,) s: output times of the run."""
        self._sides, self._agenda, self._situation, self._times = sides, sides.agenda, sides.situation, times
        self._steps = 0
        """Number of steps of earlier segments, accepted or rejected."""

    def __call__(self, begin: Beginning) -> Segment:
        """Run to the next event, to the next time at which one is due, or to the end.

        No segment can start near a singular position of a closed chain. An event on time that is due there happens
        before its instant: the segment is integrated again, to a position far enough from the singular one.
        """
        stop, due = self._agenda.next_stop(begin.state.t)
        again = begin._replace(y=begin.y.copy())
        segment = self._to(stop, begin, due)
        if due and self._situation.system.scene.constraints:
            early = too_near(self._situation, self._left, segment.raw, again.state.t, stop)
            if early:
                segment = self._to(stop - early, again, due)
                segment = segment._replace(early=early if segment.raw.t == stop - early else segment.early)
        self._steps += segment.raw.counts[ACCEPTED] + segment.raw.counts[REJECTED]
        return segment

    def _to(self, stop: float, begin: Beginning, due: Sequence[SceneEvent]) -> Segment:
        """Run to the next level that is watched, or to `stop` (s), where the events `due` happen."""
        times, shown = self._output(begin, stop)
        early, is_last = 0.0, stop == self._times[-1]
        with self._situation.integration() as solve:
            levels = self._sides.watching(solve)
            goes_on = not is_last or bool(due)
            raw = integrate(solve, begin, times, self._left, levels, breaks=goes_on, goes_on=goes_on)
            found = self._agenda.found(raw, levels, due, stop)
            if levels is not None:
                if not all(isinstance(action, EndRun) for event in found for action in event.actions):
                    raw, early = placed(self._situation, self._left, raw, levels, times)
                elif levels.leap[0] < raw.t < levels.leap[1]:
                    raw = raw._replace(memory=None)  # the run ends within a leap, from which it cannot be resumed
            kept = shown[: len(raw.states)]
            part = self._situation.observed(raw._replace(states=raw.states[kept]), times[: len(kept)][kept], solve)
        if part.status is not Status.OK or raw.interrupted:
            return Segment(SegmentEnd.FAILURE, raw, levels, part, [], early)
        if found:
            return Segment(SegmentEnd.EVENT, raw, levels, part, found, early)
        is_over = raw.t == self._times[-1]
        assert is_over or raw.t == self._agenda.until  # nothing else stops a segment
        return Segment(SegmentEnd.TIME if is_over else SegmentEnd.LEAP, raw, levels, part, found, early)

    def _output(self, begin: Beginning, stop: float) -> tuple[Real, Flags]:
        """Times (K,) s from the start of a segment to its stop, and which of them are output times of the run."""
        start, is_last = begin.state.t, stop == self._times[-1]
        if begin.memory is not None:
            start = max(start, self._times[0])
        if is_last and start == self._times[0]:
            return self._times, np.ones(len(self._times), bool)
        wanted = self._times[(self._times >= start) & ((self._times < stop) | is_last)]
        times = np.unique([start, *wanted, stop])
        return times, np.isin(times, wanted)

    @property
    def _left(self) -> Settings:
        """The settings with the number of steps that earlier segments have left."""
        settings = self._situation.settings
        return replace(settings, max_steps=max(settings.max_steps - self._steps, 0)) if self._steps else settings
