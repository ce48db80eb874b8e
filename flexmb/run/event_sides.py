"""Keeps, from instant to instant, on which side of its level each watched quantity is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.integrate.watch import UNKNOWN, Watch, watch
from flexmb.run.agenda import Agenda
from flexmb.run.event_memory import EventMemory
from flexmb.run.propagate import Integration, Raw
from flexmb.scene.schema import SceneEvent
from flexmb.typing import Index, Real

DIRECTIONS = {"rising": 1, "falling": -1, "either": 0}


class Sides:
    """`side` and `came` as in `Watch`, by name of the event."""

    def __init__(self, agenda: Agenda) -> None:
        self.side, self.came = dict[str, int](), dict[str, int]()
        self.agenda, self.situation = agenda, agenda.situation

    def start(self, y: Real) -> None:
        """Set the sides at the start of a run."""
        self.side = {event.name: self._first_side(event, y) for event in self.agenda.watched}
        self.came = dict.fromkeys(self.side, 0)

    def make_known(self) -> None:
        """Set the sides of events that were not watched before: the side from which they can happen."""
        for event in self.agenda.watched:
            if event.name not in self.side:
                self.side[event.name], self.came[event.name] = -DIRECTIONS[event.crossing], 0

    def take(self, watched: Sequence[SceneEvent], side: Index, came: Index) -> None:
        """Copy sides from a `Watch`, whose entries are in the order of `watched`."""
        names = [event.name for event in watched]
        self.side, self.came = (dict(zip(names, column.tolist(), strict=True)) for column in (side, came))

    def remember(self, anew: bool) -> EventMemory | None:
        """The present state of all events of the scene, for a restart; see `EventMemory` for `anew`."""
        names, agenda = [event.name for event in self.situation.system.scene.events], self.agenda
        if not names:
            return None
        side = [1 if name in agenda.done else self.side.get(name, 0) for name in names]
        came = [self.came.get(name, 0) for name in names]
        passed = [int(name in agenda.passed) for name in names]
        whole = (np.array(column, np.int64) for column in (side, came, passed))
        return EventMemory(*whole, agenda.until, anew, 0, self.situation.given)

    def recall(self, memory: EventMemory) -> None:
        """Restore the state that the resumed run had saved."""
        agenda = self.agenda
        agenda.until = memory.until
        for i, event in enumerate(agenda.events):
            if memory.passed[i]:
                agenda.passed.add(event.name)
            if event.watch != "time":
                self.side[event.name], self.came[event.name] = int(memory.side[i]), int(memory.came[i])
            elif memory.side[i]:
                agenda.done.add(event.name)

    def near(self, event: SceneEvent) -> float:
        """Distance within which a quantity counts as being at its level, by the tolerances of the run."""
        settings = self.situation.settings
        return settings.atol + settings.rtol * abs(event.level)

    def _first_side(self, event: SceneEvent, y: Real) -> int:
        """The side of a quantity at the start of a run; if it is at its level, the side towards which it moves.

        So an event whose quantity starts at its level does not happen until the quantity has left the level and
        returned. The sides of signals are determined in the first step.
        """
        if self.is_signal(event):
            return UNKNOWN
        height, rate = y[self.situation.places[event.watch]] - event.level, self.situation.rate_of(event.watch)
        if abs(height) > self.near(event):
            return int(np.sign(height))
        return 0 if rate is None or self.situation.is_held(event.watch) else int(np.sign(y[rate]))

    def is_signal(self, event: SceneEvent) -> bool:
        return event.watch not in self.situation.places

    def probe(self, raw: Raw, event: SceneEvent, y: Real) -> tuple[float, float]:
        """Height of what an event watches above its level, and its rate, at the end of an integration, but with another
        y = [q, u, work]."""
        rate = self.situation.rate_of(event.watch)
        if not self.is_signal(event):
            return float(y[self.situation.places[event.watch]] - event.level), 0.0 if rate is None else float(y[rate])
        begin = self.situation.going_on(self.situation.with_motion(raw, y))
        with self.situation.integration() as solve:
            assert solve.feedback is not None
            place = solve.feedback.place_of(event.watch)
            height = solve.feedback.signals(begin)[place] - event.level
            return float(height), float(solve.feedback.signal_rates(begin)[place])

    def watching(self, solve: Integration) -> Watch | None:
        """What an integration has to watch; None if it is nothing."""
        watched = self.agenda.watched
        if not watched:
            return None
        entries, still = [], []
        for event in watched:
            if self.is_signal(event):
                assert solve.feedback is not None
                entries.append(-1 - solve.feedback.place_of(event.watch))
                still.append(self.near(event))
            else:
                entries.append(self.situation.places[event.watch])
                still.append(0.0)
        directions = [DIRECTIONS[event.crossing] for event in watched]
        levels, names = [event.level for event in watched], [event.name for event in watched]
        sides, came = [self.side[name] for name in names], [self.came[name] for name in names]
        return watch(entries, levels, directions, sides, came, still, solve.size)

    def arriving(self, raw: Raw, found: Sequence[SceneEvent], levels: Watch | None, y: Real) -> list[SceneEvent]:
        """The events among `found` whose quantities move towards their levels; sets coordinates in y exactly to theirs.

        Because of rounding, an event that just happened may be found again while its quantity leaves the level.
        """
        off = []
        for i, event in enumerate(self.agenda.watched):
            if levels is not None and event in found:
                if self.is_signal(event):
                    has_jumped = not levels.found[i] or self.side[event.name] * levels.value[i] < -self.near(event)
                    rate = levels.rate[i] or self.probe(raw, event, y)[1]  # 0 if the step was as short as ulp(t)
                    rate = 0.0 if has_jumped else rate
                else:
                    y[self.situation.places[event.watch]] = event.level
                    place = self.situation.rate_of(event.watch)
                    rate = 0.0 if place is None else y[place]
                if self.side[event.name] * rate > 0.0:
                    off.append(event)
        return [event for event in found if event not in off]

    def move(self, raw: Raw, found: Sequence[SceneEvent], y: Real) -> None:
        """Update sides after events. A quantity at its level is on the side to which it moves next, or at the level (0)
        if it is at rest; then the next steps decide, and `came` is the side from which it arrived.

        Jumps of signals that events cause do not count as reaching a level.
        """
        watched = self.agenda.watched
        heights = self._heights(raw, y, [event for event in watched if self.is_signal(event)])
        for event in watched:
            is_signal, side, came = self.is_signal(event), self.side.get(event.name, 0), self.came.get(event.name, 0)
            if event in found:
                self.side[event.name], self.came[event.name] = self._side_after(raw, event, side, y)
                continue
            height = heights[event.name] if is_signal else y[self.situation.places[event.watch]] - event.level
            if abs(height) > (self.near(event) if is_signal else 0.0):
                self.side[event.name], self.came[event.name] = int(np.sign(height)), 0
            else:
                self.side[event.name], self.came[event.name] = UNKNOWN if is_signal else side, came

    def _side_after(self, raw: Raw, event: SceneEvent, came: int, y: Real) -> tuple[int, int]:
        """`side` and `came` of a quantity found at its level, which passes it, returns, or stays."""
        if self.situation.is_held(event.watch):
            return 0, 0
        if self.situation.rate_of(event.watch) is None and not self.is_signal(event):
            return -came, 0
        height, rate = self.probe(raw, event, y)
        if abs(height) > self.near(event):
            return int(np.sign(height)), 0  # a signal that jumped, also by its own event
        if rate == 0.0:
            return UNKNOWN if self.is_signal(event) else 0, came
        return (-came if came * rate < 0.0 else came), 0

    def _heights(self, raw: Raw, y: Real, events: Sequence[SceneEvent]) -> dict[str, float]:
        """Heights of signals above their levels, before controllers that are due act."""
        if not events:
            return {}
        with self.situation.integration() as solve:
            assert solve.feedback is not None
            signals = solve.feedback.signals(self.situation.going_on(self.situation.with_motion(raw, y)))
            return {event.name: float(signals[solve.feedback.place_of(event.watch)] - event.level) for event in events}
