"""The events of a run from instant to instant: which can still happen, when those on time are due, on which side of its
level each watched quantity is, which bodies touch a stop at the start, and whether a run chatters.

Chattering (Zeno behaviour) are so many events in so short a time that the run would never reach its end.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from msgspec import structs

from flexmb.control.schedule import slack
from flexmb.integrate.watch import UNKNOWN, Watch, watch
from flexmb.run.event_record import EventMemory, EventRecord
from flexmb.run.propagate import Integration, Raw
from flexmb.run.situation import Situation
from flexmb.scene.events import Dock, Impact
from flexmb.scene.schema import SceneEvent
from flexmb.scene.sticking import events_of
from flexmb.scene.tree import watchable
from flexmb.tables.status import Status
from flexmb.typing import Index, Real

# A run ends when MANY instants of events, or FEW between which nothing moves by more than `atol`, lie within the
# fraction PART of its duration. A Zeno sequence meets any such criterion: its intervals shrink geometrically.
MANY, FEW, PART = 1000, 50, 1e-6
ULPS = 16.0  # events within ULPS ulp(t) of each other make no progress


class Chattering:
    """Counts the instants of events in a run from t_start to t_end (s)."""

    def __init__(self, t_start: float, t_end: float, atol: float) -> None:
        self._soon, self._atol = PART * (t_end - t_start), atol
        self._instants: list[float] = []
        self._idle: list[float] = []
        """Times of the latest events, between which nothing moved by more than `atol`."""

    def count(self, t_before: float, t: float, speeds: tuple[Real, Real]) -> None:
        """Count an instant of events at t (s) after a segment from t_before with these speeds (nu,) at its two ends."""
        fastest, lasted = max(np.max(np.abs(u), initial=0.0) for u in speeds), t - t_before
        if fastest * lasted > self._atol and lasted > ULPS * np.spacing(abs(t)):
            self._idle.clear()
        self._idle.append(t)
        self._instants.append(t)

    @property
    def is_endless(self) -> bool:
        """Whether the events counted so far amount to chattering."""
        return any(
            len(times) >= many and times[-1] - times[-many] < self._soon
            for times, many in ((self._idle, FEW), (self._instants, MANY))
        )


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
        events, names = events_of(scene), watchable(scene) if scene.events else {}
        self.events = tuple(structs.replace(event, watch=names.get(event.watch, event.watch)) for event in events)
        self.of_friction = {event.name for event in events[len(scene.events) :]}
        """Names of events that end a phase of friction."""

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

    def forget(self, names: Iterable[str]) -> None:
        """Events of these names are others from now on."""
        for name in names:
            self.side.pop(name, None)
            self.came.pop(name, None)

    def take(self, watched: Sequence[SceneEvent], side: Index, came: Index) -> None:
        """Copy sides from a `Watch`, whose entries are in the order of `watched`."""
        names = [event.name for event in watched]
        self.side, self.came = (dict(zip(names, column.tolist(), strict=True)) for column in (side, came))

    def remember(self, anew: bool) -> EventMemory | None:
        """The present state of all events of the scene, for a restart; see `EventMemory` for `anew`."""
        names, agenda = [event.name for event in self.agenda.events], self.agenda
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
        if event.name in self.agenda.of_friction:
            return -DIRECTIONS[event.crossing]
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
            docks = any(isinstance(action, Dock) for action in event.actions)  # a closure may hold it at its level
            return UNKNOWN if self.is_signal(event) else 0, 0 if docks else came
        return (-came if came * rate < 0.0 else came), 0

    def _heights(self, raw: Raw, y: Real, events: Sequence[SceneEvent]) -> dict[str, float]:
        """Heights of signals above their levels, before controllers that are due act."""
        if not events:
            return {}
        with self.situation.integration() as solve:
            assert solve.feedback is not None
            signals = solve.feedback.signals(self.situation.going_on(self.situation.with_motion(raw, y)))
            return {event.name: float(signals[solve.feedback.place_of(event.watch)] - event.level) for event in events}


class Stood(NamedTuple):
    """What happened at a stop, and from then on its `side` and `came` as in `flexmb.integrate.watch.Watch`."""

    records: list[EventRecord]
    side: int
    came: int


def stand(sides: Sides, event: SceneEvent, raw: Raw, y: Real) -> Stood | None:
    """Process a body that is in contact with a stop at the end of an integration, changing y = [q, u, work] in place;
    None if there is none."""
    situation = sides.situation
    impact = _stop(situation, event)
    if impact is None or situation.is_held(event.watch) or situation.is_held(impact.coordinate):
        return None
    height, rate = sides.probe(raw, event, y)
    if abs(height) > sides.near(event):
        return None
    speed = situation.speed(impact.coordinate, y)
    towards = int(np.sign(rate)) if speed else 0
    pressed, falls = _pressed(sides, event, impact, raw, y)
    side = -DIRECTIONS[event.crossing] or -pressed or towards
    if side * towards < 0:
        _put(situation, event, y)
        records = situation.happen(event, raw, y)
        moves = situation.speed(impact.coordinate, y) != 0.0 and not situation.is_held(impact.coordinate)
        return Stood(records, side if moves else 0, 0 if moves or situation.is_held(impact.coordinate) else side)
    if side * towards > 0:
        return Stood([], side, 0)
    if side * pressed >= 0:
        return Stood([], 0, side)
    _put(situation, event, y)
    if impact.rests:
        return Stood([situation.rest(event, impact, -falls, raw.t, y)], 0, 0)
    return Stood([], 0, side)


def _stop(situation: Situation, event: SceneEvent) -> Impact | None:
    """The impact of an event that watches a coordinate or signal: neither time nor the rate of a coordinate."""
    is_place = event.watch not in situation.places or situation.rate_of(event.watch) is not None
    impacts = [action for action in event.actions if isinstance(action, Impact)]
    return impacts[0] if is_place and impacts else None


def _pressed(sides: Sides, event: SceneEvent, impact: Impact, raw: Raw, y: Real) -> tuple[int, int]:
    """Signs of the motions of the watched quantity and of the coordinate from rest, if there were no stop."""
    situation = sides.situation
    still = situation.at_rest(impact.coordinate, raw.t, y)
    gained, moving = situation.accelerations(raw, still), still.copy()
    moving[situation.system.nq : -1], still[situation.system.nq : -1] = gained, 0.0
    _, ahead = sides.probe(raw, event, moving)
    _, before = sides.probe(raw, event, still)
    return int(np.sign(ahead - before)), int(np.sign(situation.speed(impact.coordinate, moving)))


def _put(situation: Situation, event: SceneEvent, y: Real) -> None:
    """Set a watched coordinate exactly to its level, as when it reaches it."""
    if event.watch in situation.places:
        y[situation.places[event.watch]] = event.level
