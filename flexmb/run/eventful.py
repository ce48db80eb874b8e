"""Runs of scenes with events: from event to event in compiled code, what happens there in Python, joined to one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from msgspec import structs

from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import UNKNOWN, Watch, watch
from flexmb.run.joining import joined
from flexmb.run.origin import Beginning
from flexmb.run.outputs import observed
from flexmb.run.propagate import Integration, Raw, integrate, integration
from flexmb.run.resting import with_stops
from flexmb.run.situation import EventRecord, Situation
from flexmb.run.trajectory import Trajectory
from flexmb.run.within_leaps import ends_within, goes_on, longest_leap, placed
from flexmb.scene.events import EndRun
from flexmb.scene.schema import SceneEvent
from flexmb.scene.tree import watchable
from flexmb.system.algorithm import Algorithm
from flexmb.system.compile import assembled
from flexmb.system.tree_system import System
from flexmb.tables.status import Status
from flexmb.typing import Real

DIRECTIONS = {"rising": 1, "falling": -1, "either": 0}
# Chattering: so many instants of events within this part of a run, the fewer of them if nothing moves meanwhile further
# than the error that is allowed. At the pace of the others it would need a thousand million. Sequences without end come
# to any pace, for their intervals shrink by a factor, or to roundings of time.
FEW, MANY, SHORT = 50, 1000, 1e-6
HARDLY = 16.0  # roundings of time: what follows so soon advances no time


def _by_what_they_watch(system: System) -> tuple[SceneEvent, ...]:
    """The scene's events, sensors replaced by what they measure."""
    if not system.scene.events:
        return ()
    names = watchable(system.scene)
    return tuple(structs.replace(event, watch=names.get(event.watch, event.watch)) for event in system.scene.events)


class _Piece(NamedTuple):
    """From one event to the next: how it ended, what was watched, its trajectory, what is found at its end.

    early (s): how long before the instant of what is found it ended.
    """

    raw: Raw
    levels: Watch | None
    part: Trajectory
    found: list[SceneEvent]
    early: float


class EventfulRun:
    """One run of a scene with events."""

    def __init__(
        self, system: System, times: Real, settings: Settings, algorithm: Algorithm, stabilise: float
    ) -> None:
        """times (T,) s of the output."""
        scene = with_stops(system.scene)
        whole = system if scene == system.scene else assembled(scene)
        self._situation, self._times, self._settings = Situation(whole, settings), times, settings
        self._algorithm, self._stabilise = algorithm, stabilise
        self._events = _by_what_they_watch(whole)
        self._happened: list[EventRecord] = []
        self._paused_at: list[float] = []
        self._idle: list[float] = []
        """Times of the last events, between which nothing moved."""
        self._passed, self._until = set[str](), -np.inf
        """Names of events that happened before their instant, and the time (s) up to which they are not watched."""
        self._whole: Trajectory | None = None

    @property
    def system(self) -> System:
        """As events have left it."""
        return self._situation.system

    def __call__(self, begin: Beginning) -> tuple[Trajectory, Raw]:
        """The trajectory, and the last piece of the run as the integrator left it."""
        watched = self._watched
        sides, came = self._sides(watched, begin.y), [0] * len(watched)
        while True:
            piece = self._piece(begin, watched, sides, came)
            raw, levels = piece.raw, piece.levels
            if not (piece.found or self._is_armed_again(raw)):
                return self._ended(raw), raw
            y, controlled = self._apart(raw.y)
            arrived = piece.found if piece.early else self._arriving(piece.found, watched, levels, y)
            if piece.found:
                self._count(begin, raw)
            for event in arrived:
                records = self._situation.happen(event, raw.t, y, partial(self._accelerations, raw))
                self._happened += [replace(record, early=piece.early) for record in records]
            raw = raw._replace(y=np.concatenate([y[:-1], controlled, y[-1:]]))
            ends = any(isinstance(action, EndRun) for event in arrived for action in event.actions)
            if ends or self._chatters() or raw.t >= self._times[-1]:
                return self._ended(self._last(raw, ends)), raw
            names = [event.name for event in watched]
            side_of = dict(zip(names, self._sides_after(watched, levels, y), strict=True))
            came_of = dict(zip(names, self._came(watched, levels, y), strict=True))
            self._events = _by_what_they_watch(self.system)  # rest on a stop adds one
            watched = self._watched
            anew = zip(watched, self._sides(watched, y), strict=True)
            sides = [side_of.get(event.name, side) for event, side in anew]
            came = [came_of.get(event.name, 0) for event in watched]
            begin = self._going_on(raw)

    @property
    def _watched(self) -> list[SceneEvent]:
        return [event for event in self._armed if event.watch != "time"]

    @property
    def _armed(self) -> list[SceneEvent]:
        return [event for event in self._events if event.name not in self._passed]

    def _accelerations(self, raw: Raw, t: float, y: Real) -> Real:
        """Under what controllers say where a piece ended, with another motion y = [q, u, work] there."""
        there = raw._replace(y=np.concatenate([y[:-1], self._apart(raw.y)[1], y[-1:]]))
        with self._integration() as solve:
            assert solve.feedback is not None  # of a scene with stops to rest on
            return solve.feedback.accelerations(self._going_on(there))

    def _apart(self, y: Real) -> tuple[Real, Real]:
        """[q, u, work], and the states of controllers, which events do not touch."""
        motion = self.system.nq + self.system.nu
        return np.r_[y[:motion], y[-1]], y[motion:-1]

    def _going_on(self, raw: Raw) -> Beginning:
        """From where a piece ended; controllers know what they knew."""
        state = self.system.layout.known(raw.t, np.r_[self._apart(raw.y)[0][:-1], 0.0])
        return Beginning(state, raw.y, None, raw.controllers)

    def _piece(
        self, begin: Beginning, watched: Sequence[SceneEvent], sides: Sequence[int], came: Sequence[int]
    ) -> _Piece:
        """Run to the next event, or to the next time at which one is due, or to the end; outputs are joined."""
        t, again = begin.state.t, begin._replace(y=begin.y.copy())
        timed = [event for event in self._armed if event.watch == "time" and t < event.level < self._times[-1]]
        stop = min([*(event.level for event in timed), *[self._until] * (t < self._until), self._times[-1]])
        due = [event for event in timed if event.level == stop]
        watching = partial(self._watch, watched, sides, came)
        piece = self._run_to(stop, begin, watching, due)
        early = longest_leap(self.system, piece.raw) if due and self.system.scene.closures else np.inf
        if early < stop - t and self._is_singular(piece.raw, stop, early):
            piece = self._run_to(stop - early, again, watching, due)
            piece = piece._replace(early=early if piece.raw.t == stop - early else piece.early)
        elif stop == self._times[-1]:
            beyond = ends_within(self.system, piece.raw, stop)
            piece = self._run_to(stop, again, watching, due, beyond) if beyond else piece
        if piece.early:
            self._passed |= {event.name for event in piece.found}
            self._until = piece.raw.t + 2.5 * piece.early
        self._join(piece.part)
        return piece

    def _run_to(
        self, stop: float, begin: Beginning, watching: Callable[[Integration], Watch | None],
        due: Sequence[SceneEvent], beyond: float = 0.0,
    ) -> _Piece:  # fmt: skip
        t = begin.state.t
        start = max(t, self._times[0]) if begin.memory is not None else t
        is_last = stop == self._times[-1]
        wanted = self._times[(self._times >= start) & ((self._times < stop) | is_last)]
        times, early = np.unique([start, *wanted, stop]), 0.0
        with self._integration() as solve:
            levels = watching(solve)
            raw = integrate(self.system, solve, begin, times, self._left(), levels, not is_last, beyond)
            found = self._found(raw, levels, due if raw.t == stop else ())
            if levels is not None and not all(isinstance(each, EndRun) for event in found for each in event.actions):
                raw, early = placed(raw, levels, times, self._further, self._speeds)
            kept = np.isin(times[: len(raw.states)], wanted)
            shown = raw._replace(states=raw.states[kept])
            part = observed(self.system, times[: len(raw.states)][kept], shown, self._algorithm, solve)
        return _Piece(raw, levels, part, found if part.status is Status.OK else [], early)

    def _is_singular(self, raw: Raw, due: float, near: float) -> bool:
        """Whether a singular position is so near (s) to a time that is due that nothing goes on from there."""
        if raw.status is Status.OK:
            return raw.t == due and not goes_on(raw, near, self._further, self._speeds)
        return ends_within(self.system, raw, due) > 0.0

    def _further(self, raw: Raw, t: float) -> Raw:
        """On to a time (s), whatever comes to its level."""
        begin = self._going_on(raw._replace(y=raw.y.copy()))
        with self._integration() as solve:
            nothing = watch((), (), (), (), (), (), self._size(solve))
            return integrate(self.system, solve, begin, np.array([raw.t, t]), self._left(), nothing)

    def _integration(self) -> AbstractContextManager[Integration]:
        return integration(self.system, self._algorithm, self._stabilise, self._settings.integrator)

    @property
    def _speeds(self) -> slice:
        return slice(self.system.nq, self.system.nq + self.system.nu)

    def _is_armed_again(self, raw: Raw) -> bool:
        """Whether a piece ended where events are watched again that happened before their instant."""
        if raw.status is Status.OK and not raw.interrupted and raw.t == self._until < self._times[-1]:
            self._passed.clear()
            return True
        return False

    def _left(self) -> Settings:
        """The settings with as many steps as the pieces before have left."""
        if self._whole is None:
            return self._settings
        done = self._whole.statistics.accepted_steps + self._whole.statistics.rejected_steps
        return replace(self._settings, max_steps=max(self._settings.max_steps - done, 0))

    def _found(self, raw: Raw, levels: Watch | None, due: Sequence[SceneEvent]) -> list[SceneEvent]:
        """What happens where a piece ended, in the order of the scene: what came to its level, and what is due."""
        if raw.status is not Status.OK or raw.interrupted:
            return []
        crossed = [self._watched[i] for i in np.flatnonzero(levels.found)] if levels is not None and raw.paused else []
        return [event for event in self._events if event in crossed or event in due]

    def _arriving(
        self, found: Sequence[SceneEvent], watched: Sequence[SceneEvent], levels: Watch | None, y: Real
    ) -> list[SceneEvent]:
        """Those that come to their levels, where coordinates are set exactly.

        Rounding may find one again that flies off.
        """
        off = []
        for i, event in enumerate(watched):
            if levels is not None and event in found:
                if self._is_signal(event):
                    rate = levels.rate[i]
                else:
                    y[self._situation.places[event.watch]] = event.level
                    place = self._situation.rate_of(event.watch)
                    rate = 0.0 if place is None else y[place]
                if levels.side[i] * rate > 0.0:
                    off.append(event)
        return [event for event in found if event not in off]

    def _is_signal(self, event: SceneEvent) -> bool:
        return event.watch not in self._situation.places

    def _watch(
        self, watched: Sequence[SceneEvent], sides: Sequence[int], came: Sequence[int], solve: Integration
    ) -> Watch | None:
        if not watched:
            return None
        entries, still = [], []
        for event in watched:
            if self._is_signal(event):
                assert solve.feedback is not None
                entries.append(-1 - solve.feedback.place_of(event.watch))
                still.append(self._settings.atol + self._settings.rtol * abs(event.level))
            else:
                entries.append(self._situation.places[event.watch])
                still.append(0.0)
        directions = [DIRECTIONS[event.crossing] for event in watched]
        levels = [event.level for event in watched]
        return watch(entries, levels, directions, sides, came, still, self._size(solve))

    def _size(self, solve: Integration) -> int:
        """Of what is integrated, [q, u, work] or [q, u, x, work]."""
        controlled = 0 if solve.feedback is None else len(solve.feedback.state_names)
        return self.system.nq + self.system.nu + controlled + 1

    def _sides(self, watched: Sequence[SceneEvent], y: Real) -> list[int]:
        """On which side of its level everything is; 0 at it. Those of signals are seen in the first step."""
        places = self._situation.places
        return [
            UNKNOWN if self._is_signal(event) else int(np.sign(y[places[event.watch]] - event.level))
            for event in watched
        ]

    def _came(self, watched: Sequence[SceneEvent], levels: Watch | None, y: Real) -> list[int]:
        """From which side what is at its level came, where its rate does not tell where it goes on to; 0 for others."""
        return [
            int(levels.side[i]) if levels is not None and levels.found[i] and self._stays(event, y) else 0
            for i, event in enumerate(watched)
        ]

    def _stays(self, event: SceneEvent, y: Real) -> bool:
        """Whether the next step sees on which side of its level something is: a signal, or what is left at rest."""
        if self._is_signal(event):
            return True
        rate = self._situation.rate_of(event.watch)
        return rate is not None and y[rate] == 0.0 and not self._situation.is_held(event.watch)

    def _sides_after(self, watched: Sequence[SceneEvent], levels: Watch | None, y: Real) -> list[int]:
        """After an event. What was found at its level is beyond it, or back where it does not go on; else at it: 0."""
        sides = self._sides(watched, y)
        for i, event in enumerate(watched):
            came = int(levels.side[i]) if levels is not None else 0
            if self._is_signal(event):
                continue
            if levels is not None and levels.found[i]:
                rate = self._situation.rate_of(event.watch)
                goes_on = rate is None or -came * y[rate] > 0.0
                is_at_it = self._situation.is_held(event.watch) or self._stays(event, y)
                sides[i] = 0 if is_at_it else -came if goes_on else came
            elif sides[i] == 0:
                sides[i] = came
        return sides

    def _count(self, begin: Beginning, raw: Raw) -> None:
        """An event that ends a piece; it is idle if neither speeds at the piece's ends nor time led anywhere."""
        fastest = max(np.max(np.abs(u), initial=0.0) for u in (begin.state.u, raw.y[self._speeds]))
        lasted = raw.t - begin.state.t
        if fastest * lasted > self._settings.atol and lasted > HARDLY * np.spacing(abs(raw.t)):
            self._idle.clear()
        self._idle.append(raw.t)
        self._paused_at.append(raw.t)

    def _chatters(self) -> bool:
        soon = SHORT * (self._times[-1] - self._times[0])
        return any(
            len(times) >= many and times[-1] - times[-many] < soon
            for times, many in ((self._idle, FEW), (self._paused_at, MANY))
        )

    def _last(self, raw: Raw, ends: bool) -> Raw:
        """The state after the last event is an output too."""
        last = raw._replace(states=raw.y[None])
        if not ends and raw.t < self._times[-1]:
            last = last._replace(status=Status.CHATTERING)
        system = self.system
        with self._integration() as solve:
            if solve.feedback is not None:
                solve.feedback.look(self._going_on(raw))
            found = observed(system, np.array([raw.t]), last, self._algorithm, solve)
        if ends:
            found = replace(found, message=f'ended by event "{self._happened[-1].name}" at t = {raw.t:g} s')
        elif last.status is Status.CHATTERING:
            names = dict.fromkeys(f'"{event.name}"' for event in self._happened[-FEW:])
            found = replace(found, message=f"{found.message}; the last were {' and '.join(names)}")
        cost = {name: 0 for name in vars(found.statistics)}
        self._join(replace(found, statistics=replace(found.statistics, **cost)))
        return last

    def _join(self, part: Trajectory) -> None:
        self._whole = part if self._whole is None else joined(self._whole, part)

    def _ended(self, raw: Raw) -> Trajectory:
        assert self._whole is not None  # there was a piece
        return replace(self._whole, events=tuple(self._happened))
