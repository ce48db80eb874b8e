"""Segments of a run: each is integrated in compiled code from its start to the next event or the end of the run.

Within a leap of a closed chain over a singular position (`flexmb.closure.leap`) the motion is known from polynomials
alone, and events are located in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from flexmb.integrate.control import ACCEPTED, REJECTED
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import Watch, watch
from flexmb.run.agenda import Sides
from flexmb.run.origin import Beginning
from flexmb.run.propagate import Raw, integrate
from flexmb.run.situation import Situation
from flexmb.run.trajectory import Trajectory
from flexmb.scene.events import EndRun
from flexmb.scene.schema import SceneEvent
from flexmb.system.system import System
from flexmb.tables.status import Status
from flexmb.typing import Flags, Real

AT_SINGULAR_POSITIONS = (Status.CLOSURE_SINGULAR, Status.BRANCH_UNKNOWN, Status.CLOSURE_OPEN)


def placed(situation: Situation, left: Settings, raw: Raw, levels: Watch, times: Real) -> tuple[Raw, float]:
    """A segment that reached a level, ended where the event happens, and how long (s) before its instant that is.

    left: settings with the number of steps that are left. times (T,) s: output times of the segment.
    """
    start, end = levels.leap.tolist()
    if not start < raw.t < end or _goes_on(situation, left, raw, end - start):
        return raw, 0.0
    before = raw.states[times[: len(raw.states)] <= start]
    return raw._replace(states=before, y=levels.before.copy(), t=start), raw.t - start


def too_near(situation: Situation, left: Settings, raw: Raw, t_start: float, due: float) -> float:
    """How long (s) before the time `due` its event has to happen, given the segment up to there; 0 if at that time.

    t_start (s): start of the segment, before which the event cannot happen.
    """
    longest = _longest_leap(situation.system, raw)
    if not longest < due - t_start:  # NaN is no length either
        return 0.0
    if raw.status is Status.OK:
        is_near = raw.t == due and not _goes_on(situation, left, raw, longest)
    else:
        is_near = raw.status in AT_SINGULAR_POSITIONS and due - raw.t <= longest
    return longest if is_near else 0.0


def _goes_on(situation: Situation, left: Settings, raw: Raw, span: float) -> bool:
    """Whether a segment of length `span` (s) can start where another ended, with its speeds and with reversed ones."""
    back = raw.y.copy()
    back[situation.speeds] *= -1.0
    for y in (raw.y.copy(), back):
        begin = situation.going_on(raw._replace(y=y))
        with situation.integration() as solve:
            nothing = watch((), (), (), (), (), (), solve.size)  # the same compiled code as for segments
            tried = integrate(solve, begin, np.array([raw.t, raw.t + span]), left, nothing, goes_on=True)
        if tried.status in AT_SINGULAR_POSITIONS:
            return False
    return True


def _longest_leap(system: System, raw: Raw) -> float:
    """The longest duration (s) of a leap at the end of a segment; infinite at rest."""
    from flexmb.closure.leap import LEAP  # imported here because trees do not need it

    assert system.closures is not None  # only chains leap
    return 2.0 * LEAP * system.closures.passing_time(raw.t, np.r_[raw.y[: system.nq + system.nu], 0.0])


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
        may_be_early = due and self._situation.system.scene.constraints
        again = begin._replace(y=begin.y.copy()) if may_be_early else begin
        segment = self._to(stop, begin, due)
        if may_be_early:
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
            seen = raw
            if shown is None:
                times = times[: len(raw.states)]
            else:
                kept = shown[: len(raw.states)]
                seen, times = raw._replace(states=raw.states[kept]), times[: len(kept)][kept]
            part = self._situation.observed(seen, times, solve)
        if part.status is not Status.OK or raw.interrupted:
            return Segment(SegmentEnd.FAILURE, raw, levels, part, [], early)
        if found:
            return Segment(SegmentEnd.EVENT, raw, levels, part, found, early)
        is_over = raw.t == self._times[-1]
        assert is_over or raw.t == self._agenda.until  # nothing else stops a segment
        return Segment(SegmentEnd.TIME if is_over else SegmentEnd.LEAP, raw, levels, part, found, early)

    def _output(self, begin: Beginning, stop: float) -> tuple[Real, Flags | None]:
        """Times (K,) s from the start of a segment to its stop, and which of them are output times of the run; None of
        all."""
        start, is_last = begin.state.t, stop == self._times[-1]
        if begin.memory is not None:
            start = max(start, self._times[0])
        if is_last and start == self._times[0]:
            return self._times, None
        wanted = self._times[(self._times >= start) & ((self._times < stop) | is_last)]
        times = np.unique([start, *wanted, stop])
        return times, np.isin(times, wanted)

    @property
    def _left(self) -> Settings:
        """The settings with the number of steps that earlier segments have left."""
        settings = self._situation.settings
        return replace(settings, max_steps=max(settings.max_steps - self._steps, 0)) if self._steps else settings
