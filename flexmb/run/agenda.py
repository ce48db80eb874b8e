"""The events of a scene that can still happen in a run, and the times at which events on time are due."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import structs

from flexmb.control.schedule import slack
from flexmb.integrate.watch import Watch
from flexmb.run.propagate import Raw
from flexmb.run.situation import Situation
from flexmb.scene.schema import SceneEvent
from flexmb.scene.tree import watchable
from flexmb.tables.status import Status
from flexmb.typing import Real

WATCHED_AGAIN = 2.5
"""An event that happened a time e before its instant is not watched for WATCHED_AGAIN * e: for e up to its instant, for
another e beyond it, and for a margin of e / 2."""


class Agenda:
    """The events of a scene, with a record of which have happened."""

    def __init__(self, situation: Situation, times: Real) -> None:
        """times (T,) s: output times."""
        self.situation, self._t_end = situation, float(times[-1])
        self._together = slack(float(times[0]), self._t_end)
        """Times that differ by at most this (s) count as one instant."""
        self.done = set[str]()
        """Names of events on time that have happened or were due before the start of the run."""
        self.passed, self.until = set[str](), -np.inf
        """Names of events that happened before their instant, and the time (s) until which they are not watched."""
        self.take()

    def take(self) -> None:
        """Use the events of the present scene, which earlier events may have changed. Sensors of coordinates or speeds
        are replaced by the names of these."""
        scene = self.situation.system.scene
        names = watchable(scene) if scene.events else {}
        self.events = tuple(structs.replace(event, watch=names.get(event.watch, event.watch)) for event in scene.events)

    @property
    def _armed(self) -> list[SceneEvent]:
        return [event for event in self.events if event.name not in self.passed]

    @property
    def watched(self) -> list[SceneEvent]:
        """Events on coordinates, speeds or signals, in the order of the scene."""
        return [event for event in self._armed if event.watch != "time"]

    def due_at_start(self, t: float) -> list[SceneEvent]:
        """Events on time that are due at the start t (s) of the run; earlier ones are discarded."""
        timed = [event for event in self.events if event.watch == "time"]
        self.done |= {event.name for event in timed if event.level < t - self._together}
        return [event for event in timed if abs(event.level - t) <= self._together]

    def next_stop(self, t: float) -> tuple[float, list[SceneEvent]]:
        """The next time (s) after t at which the run has to stop, and the events on time that are due then."""
        timed = [event for event in self._armed if event.watch == "time" and event.name not in self.done]
        first = min((max(event.level, t) for event in timed), default=np.inf)
        end = first if first < self._t_end - self._together else self._t_end
        stop = min(end, self.until if t < self.until else np.inf)
        return stop, [event for event in timed if event.level <= stop + self._together]

    def found(self, raw: Raw, levels: Watch | None, due: Sequence[SceneEvent], stop: float) -> list[SceneEvent]:
        """The events at the end of a segment, in the order of the scene: those whose quantity reached its level, and
        those on time that are due."""
        if raw.status is not Status.OK or raw.interrupted:
            return []
        crossed = [self.watched[i] for i in np.flatnonzero(levels.found)] if levels is not None and raw.paused else []
        due = due if raw.t >= stop - self._together else ()
        return [event for event in self.events if event in crossed or event in due]

    def happened(self, event: SceneEvent) -> None:
        """Record that an event happened: events on time happen only once."""
        if event.watch == "time":
            self.done.add(event.name)

    def pass_over(self, events: Sequence[SceneEvent], t: float, early: float) -> None:
        """Stop watching events that happened at t, `early` (s) before their instant, until they lie behind."""
        self.passed |= {event.name for event in events}
        self.until = t + WATCHED_AGAIN * early

    def watch_again(self) -> None:
        """Watch all events again."""
        self.passed.clear()
