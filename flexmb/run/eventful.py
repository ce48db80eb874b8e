"""Runs of scenes with events: from event to event in compiled code, what happens there in Python, joined to one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from msgspec import structs

from flexmb.control.schedule import slack
from flexmb.integrate.control import COUNTS
from flexmb.integrate.memory import STRETCH, TIME, Memory, memory
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import UNKNOWN, Watch, watch
from flexmb.run.event_memory import EventMemory
from flexmb.run.joining import joined
from flexmb.run.origin import Beginning
from flexmb.run.outputs import observed
from flexmb.run.propagate import Integration, Raw, integrate, integration
from flexmb.run.restart import Restart
from flexmb.run.resting import with_stops
from flexmb.run.sides import DIRECTIONS, Sides
from flexmb.run.situation import EventRecord, Situation
from flexmb.run.standing import stand
from flexmb.run.trajectory import Trajectory
from flexmb.run.within_leaps import ends_within, goes_on, longest_leap, placed
from flexmb.scene.events import EndRun
from flexmb.scene.schema import SceneEvent
from flexmb.scene.tree import watchable
from flexmb.system.algorithm import Algorithm
from flexmb.system.compile import assembled
from flexmb.system.tree_system import System
from flexmb.tables.features import asking
from flexmb.tables.status import Status
from flexmb.typing import Real

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


def _unmoved(begin: Beginning) -> Raw:
    """A run that starts, as if a piece of it had ended there."""
    nothing = np.empty((0, len(begin.y)))
    return Raw(
        nothing, Status.OK, 0, begin.state.t, [0] * COUNTS, 0.0, 0.0, interrupted=False, y=begin.y,
        memory=memory(len(begin.y), 0),
    )  # fmt: skip


class EventfulRun:
    """One run of a scene with events."""

    def __init__(
        self, system: System, times: Real, settings: Settings, algorithm: Algorithm, stabilise: float,
        taken_up: EventMemory | None = None,
    ) -> None:  # fmt: skip
        """times (T,) s of the output."""
        scene = with_stops(system.scene)
        with asking(system.kernels):
            whole = system if scene == system.scene else assembled(scene)
        self._situation = Situation(whole, settings, None if taken_up is None else taken_up.given)
        self._times, self._settings, self._taken_up = times, settings, taken_up
        self._algorithm, self._stabilise = algorithm, stabilise
        self._together = slack(float(times[0]), float(times[-1]))
        self._events = _by_what_they_watch(whole)
        self._sides = Sides(self._situation, settings, self._integration, self._beginning)
        self._done = set[str]()
        """Names of events on time that have happened, or were due before the run."""
        self._happened: list[EventRecord] = []
        self._paused_at: list[float] = []
        self._idle: list[float] = []
        """Times of the last events, between which nothing moved."""
        self._passed, self._until = set[str](), -np.inf
        """Names of events that happened before their instant, and the time (s) up to which they are not watched."""
        self._whole: Trajectory | None = None
        self._cut: Restart | None = None
        """From before the step in which an event was found though the end of the run had cut it short."""
        self.restart: Restart | None = None
        """Where the run can be taken up, once it is over."""

    @property
    def system(self) -> System:
        """As events have left it."""
        return self._situation.system

    def __call__(self, begin: Beginning) -> tuple[Trajectory, Raw]:
        """The trajectory, and the last piece of the run as the integrator left it."""
        if begin.events is None:
            raw = _unmoved(begin)
            raw, ends = self._at_instant(raw, self._due_at_start(raw.t), None)
            if ends:
                return self._over(*self._concluded(raw, ends), anew=True)
            begin = self._going_on(raw)
        else:
            self._recall(begin.events)
        while True:
            piece = self._piece(begin)
            raw, found = piece.raw, piece.found
            if raw.status is Status.OK and not raw.interrupted and not found and raw.t == self._times[-1]:
                raw = self._acted(raw, anew=False)
                found = self._jumped(raw)
            if not (found or self._is_armed_again(raw)):
                return self._over(raw, ends=False, anew=False)
            if found:
                self._count(begin, raw)
            raw, ends = self._at_instant(raw, found, piece.levels, piece.early)
            if ends or raw.t >= self._times[-1]:
                return self._over(*self._concluded(raw, ends), anew=True)
            if self._chatters():
                return self._over(raw, ends, anew=True)
            begin = self._going_on(raw)

    def _at_instant(
        self, raw: Raw, found: Sequence[SceneEvent], levels: Watch | None, early: float = 0.0
    ) -> tuple[Raw, bool]:
        """All that happens at one time, in its order: events that are found, in that of the scene, then what stands on
        stops. Controllers that are due act where a run goes on, or is over. Returns what is left, and whether it ends.
        """
        y, controlled = self._apart(raw.y)
        arrived = found if early else self._sides.arriving(self._watched, raw, found, levels, y)
        for event in arrived:
            self._do(event, raw, y, early)
        raw = raw._replace(y=np.concatenate([y[:-1], controlled, y[-1:]]))
        if self._whole is None:  # the run starts
            self._sides.start(self._watched, y)
        else:
            self._sides.move(self._watched, raw, found, y)
        struck = self._stand(raw, found, y)
        raw = raw._replace(y=np.concatenate([y[:-1], controlled, y[-1:]]))
        self._events = _by_what_they_watch(self.system)  # rest on a stop adds one
        self._sides.make_known(self._watched)
        return raw, any(isinstance(action, EndRun) for event in (*arrived, *struck) for action in event.actions)

    def _do(self, event: SceneEvent, raw: Raw, y: Real, early: float) -> None:
        records = self._situation.happen(event, raw.t, y, partial(self._accelerations, raw))
        self._happened += [replace(record, early=early) for record in records]
        if event.watch == "time":
            self._done.add(event.name)

    def _stand(self, raw: Raw, found: Sequence[SceneEvent], y: Real) -> list[SceneEvent]:
        """See `flexmb.run.standing`; which events happened."""
        struck = []
        for event in self._watched:
            is_new = event not in found and self._sides.came[event.name] == 0
            if is_new and (self._whole is None or self._sides.side[event.name] in (0, UNKNOWN)):
                stood = stand(
                    self._situation, event, raw.t, y, self._sides.near(event), partial(self._sides.probe, raw),
                    partial(self._accelerations, raw),
                )  # fmt: skip
                if stood is not None:
                    self._happened += stood.records
                    self._sides.side[event.name], self._sides.came[event.name] = stood.side, stood.came
                    struck += [event] * any(record.name == event.name for record in stood.records)
        return struck

    def _due_at_start(self, t: float) -> list[SceneEvent]:
        """Events on time that are due where the run starts; earlier ones are gone."""
        timed = [event for event in self._events if event.watch == "time"]
        self._done |= {event.name for event in timed if event.level < t - self._together}
        return [event for event in timed if abs(event.level - t) <= self._together]

    def _acted(self, raw: Raw, anew: bool) -> Raw:
        """After controllers acted that are due where the run is over. anew: integration would begin there."""
        if not self._samples:
            return raw
        with self._integration() as solve:
            assert solve.feedback is not None
            known = solve.feedback.look(self._going_on(raw), acts=True, anew=anew)
        return raw._replace(controllers=known)

    def _concluded(self, raw: Raw, ends: bool) -> tuple[Raw, bool]:
        """After events at the end of a run: controllers that are due act, and so do events on what they say."""
        raw = self._acted(raw, anew=True)
        jumped = self._jumped(raw)
        if jumped:
            raw, by_jump = self._at_instant(raw, jumped, None)
            ends = ends or by_jump
        return raw, ends

    @property
    def _samples(self) -> bool:
        return any(each.period_s for each in self.system.scene.controllers)

    def _jumped(self, raw: Raw) -> list[SceneEvent]:
        """Events on what controllers said only where the run was over already."""
        found: list[SceneEvent] = []
        if raw.controllers is None:
            return found
        with self._integration() as solve:
            assert solve.feedback is not None
            for event in self._watched:
                if self._sides.is_signal(event) and solve.feedback.is_sampled(event.watch):
                    height = raw.controllers.signal[solve.feedback.place_of(event.watch)] - event.level
                    side, direction = self._sides.side[event.name], DIRECTIONS[event.crossing]
                    if side in (-1, 1) and side * height < -self._sides.near(event) and side * direction <= 0:
                        found.append(event)
        return found

    def _remember(self, anew: bool) -> EventMemory:
        """As things are; sides of the events that are watched are those of the moment."""
        events = self.system.scene.events
        side = [1 if event.name in self._done else self._sides.side.get(event.name, 0) for event in events]
        came = [self._sides.came.get(event.name, 0) for event in events]
        passed = [int(event.name in self._passed) for event in events]
        whole = (np.array(each, np.int64) for each in (side, came, passed))
        return EventMemory(*whole, self._until, anew, 0, self._situation.given)

    def _recall(self, memory: EventMemory) -> None:
        self._until = memory.until
        for i, event in enumerate(self._events):
            if memory.passed[i]:
                self._passed.add(event.name)
            if event.watch != "time":
                self._sides.side[event.name], self._sides.came[event.name] = int(memory.side[i]), int(memory.came[i])
            elif memory.side[i]:
                self._done.add(event.name)

    def _keep_cut(self, raw: Raw) -> None:
        """Before a step that the end of the run cut short, and in which an event was found all the same: it is found
        otherwise, in the last bits, by a run that goes on."""
        if self._cut is None and raw.memory is not None:
            self._cut = self._restart(raw, raw.memory, anew=False)

    def _restart(self, raw: Raw, memory: Memory, anew: bool) -> Restart:
        events = self._remember(anew)
        return Restart(self._settings.method, self.system.scene, raw.t, memory, raw.controllers, events)

    def _restart_of(self, raw: Raw, ends: bool, anew: bool) -> Restart | None:
        """Of a run that is over: from before what its end has cut short, or from where it is."""
        if raw.memory is None:
            return None
        if self._cut is not None and self._cut.events is not None and not ends:
            shown = sum(record.t > self._cut.since for record in self._happened)
            return replace(self._cut, t=raw.t, events=self._cut.events._replace(shown=shown))
        if not anew:
            return self._restart(raw, raw.memory, anew)
        memory = self._settings.integrator.memory(len(raw.y))
        memory.numbers[TIME] = memory.numbers[STRETCH] = raw.t
        memory.y[:] = raw.y
        return self._restart(raw, memory, anew)

    def _over(self, raw: Raw, ends: bool, anew: bool) -> tuple[Trajectory, Raw]:
        """The end of the run, with what controllers say there; anew: events happened there."""
        chatters = anew and not ends and raw.t < self._times[-1]
        if anew or (self._samples and raw.status is Status.OK and raw.t == self._times[-1]):
            self._last(raw, ends, chatters)
        if not chatters and raw.status in (Status.OK, Status.MAX_STEPS, Status.INTERRUPTED):
            self.restart = self._restart_of(raw, ends, anew)
        assert self._whole is not None  # there was a piece
        return replace(self._whole, events=self._new_events()), raw

    def _new_events(self) -> tuple[EventRecord, ...]:
        """Those that the run that was taken up has not shown.

        They are counted: found again in a step that is not cut short, their instants differ by the error of its dense
        output.
        """
        return tuple(self._happened[0 if self._taken_up is None else self._taken_up.shown :])

    @property
    def _watched(self) -> list[SceneEvent]:
        return [event for event in self._armed if event.watch != "time"]

    @property
    def _armed(self) -> list[SceneEvent]:
        return [event for event in self._events if event.name not in self._passed]

    def _accelerations(self, raw: Raw, t: float, y: Real) -> Real:
        """Under what controllers say where a piece ended, with another motion y = [q, u, work] there."""
        begin = self._beginning(raw, y)
        with self._integration() as solve:
            if solve.feedback is None:
                return self.system.accelerations(begin.state, self._algorithm)
            return solve.feedback.accelerations(begin)

    def _beginning(self, raw: Raw, y: Real) -> Beginning:
        """From where a piece ended, with another motion y = [q, u, work]."""
        return self._going_on(raw._replace(y=np.concatenate([y[:-1], self._apart(raw.y)[1], y[-1:]])))

    def _apart(self, y: Real) -> tuple[Real, Real]:
        """[q, u, work], and the states of controllers, which events do not touch."""
        motion = self.system.nq + self.system.nu
        return np.r_[y[:motion], y[-1]], y[motion:-1]

    def _going_on(self, raw: Raw) -> Beginning:
        """From where a piece ended; controllers know what they knew."""
        state = self.system.layout.known(raw.t, np.r_[self._apart(raw.y)[0][:-1], 0.0])
        return Beginning(state, raw.y, None, raw.controllers)

    def _piece(self, begin: Beginning) -> _Piece:
        """Run to the next event, or to the next time at which one is due, or to the end; outputs are joined."""
        t, t_end, again = begin.state.t, float(self._times[-1]), begin._replace(y=begin.y.copy())
        timed = [event for event in self._armed if event.watch == "time" and event.name not in self._done]
        first = min((max(event.level, t) for event in timed), default=np.inf)
        stop = min(first if first < t_end - self._together else t_end, self._until if t < self._until else np.inf)
        due = [event for event in timed if event.level <= stop + self._together]
        watched = self._watched
        watching = partial(self._sides.watching, watched)
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
        levels = piece.levels
        if levels is not None and levels.kept[0]:
            self._sides.take(watched, levels.kept_side.tolist(), levels.kept_came.tolist())
            if piece.raw.paused:
                self._keep_cut(piece.raw)
        if levels is not None and (piece.raw.paused or not levels.kept[0]):
            self._sides.take(watched, levels.side.tolist(), levels.came.tolist())
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
            breaks, left = not is_last or bool(due), self._left()
            raw = integrate(solve, begin, times, left, levels, breaks, beyond, goes_on=True)
            found = self._found(raw, levels, due if raw.t >= stop - self._together else ())
            if levels is not None and not all(isinstance(each, EndRun) for event in found for each in event.actions):
                raw, early = placed(raw, levels, times, self._further, self._speeds)
            elif levels is not None and levels.leap[0] < raw.t < levels.leap[1]:
                raw = raw._replace(memory=None)  # nothing goes on from there
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
            nothing = watch((), (), (), (), (), (), self._sides.size(solve))
            return integrate(solve, begin, np.array([raw.t, t]), self._left(), nothing, goes_on=True)

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

    def _last(self, raw: Raw, ends: bool, chatters: bool) -> None:
        """The state after all that happens at the end is an output too."""
        last = raw._replace(states=raw.y[None], status=Status.CHATTERING if chatters else raw.status)
        with self._integration() as solve:
            if solve.feedback is not None:
                solve.feedback.look(self._going_on(raw), acts=False)
            found = observed(self.system, np.array([raw.t]), last, self._algorithm, solve)
        if ends:
            found = replace(found, message=f'ended by event "{self._happened[-1].name}" at t = {raw.t:g} s')
        elif chatters:
            names = dict.fromkeys(f'"{event.name}"' for event in self._happened[-FEW:])
            found = replace(found, message=f"{found.message}; the last were {' and '.join(names)}")
        cost = {name: 0 for name in vars(found.statistics)}
        self._join(replace(found, statistics=replace(found.statistics, **cost)))

    def _join(self, part: Trajectory) -> None:
        self._whole = part if self._whole is None else joined(self._whole, part)
