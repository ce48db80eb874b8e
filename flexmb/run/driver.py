"""The driver of a run: a loop over segments and the events between them, whose outputs are joined to one trajectory.

A segment is integrated in compiled code (`flexmb.run.segments`). What follows depends on why it ended (`SegmentEnd`):
at an event the actions of all events at that instant change the scene and the state, and the next segment starts with
an integrator without memory; at the end of the run's time, or after a failure, the run is over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, assert_never

import numpy as np

from flexmb.integrate.memory import STRETCH, TIME, Memory
from flexmb.integrate.settings import Settings
from flexmb.integrate.watch import UNKNOWN, Watch
from flexmb.run.agenda import DIRECTIONS, FEW, Agenda, Chattering, Sides, stand
from flexmb.run.event_record import EventMemory, EventRecord
from flexmb.run.frictions import Frictions
from flexmb.run.origin import Beginning
from flexmb.run.propagate import Raw, unmoved
from flexmb.run.provenance import Making
from flexmb.run.restart import Restart
from flexmb.run.run_arrays import joined, told
from flexmb.run.segments import Segment, SegmentEnd, Segments
from flexmb.run.situation import Situation
from flexmb.run.trajectory import Trajectory
from flexmb.scene.events import EndRun
from flexmb.scene.schema import SceneEvent
from flexmb.scene.sticking import any_sticks, names_of
from flexmb.system.algorithm import Algorithm
from flexmb.system.system import System
from flexmb.tables.status import Status
from flexmb.typing import Real

CAN_GO_ON = (Status.OK, Status.MAX_STEPS, Status.INTERRUPTED)
"""Statuses of runs that can be resumed."""


class Leg(NamedTuple):
    """A part of a run between two instants at which events happen, for those who follow the run again.

    system: the system as the events before have left it. begin: where the part begins. raw: the end of the integration,
    before the events there. events: those that happened there, with their records, `early` (s) before their instant.
    A run that ends after events ends with a part without duration.
    """

    system: System
    begin: Beginning
    raw: Raw
    events: list[SceneEvent]
    records: list[EventRecord]
    early: float


class AfterEvents(NamedTuple):
    """The state after all events of one instant, and whether one of them ends the run."""

    raw: Raw
    ends: bool


class Driver:
    """One run of a scene."""

    def __init__(
        self, system: System, times: Real, settings: Settings, algorithm: Algorithm, stabilise: float,
        taken_up: EventMemory | None = None, made_by: Making | None = None,
    ) -> None:  # fmt: skip
        """times (T,) s: output times; taken_up: the events' state at the end of the run that is resumed, if any."""
        self.course: list[Leg] | None = None
        """A list to which the parts of the run are appended."""
        self._times, self._settings, self._taken_up, self._made_by = times, settings, taken_up, made_by
        given = None if taken_up is None else taken_up.given
        self._situation = Situation(system, settings, algorithm, stabilise, given)
        self._frictions = Frictions(self._situation) if any_sticks(self._situation.system.scene) else None
        self._agenda = Agenda(self._situation, times)
        self._sides = Sides(self._agenda)
        self._segments = Segments(self._sides, times)
        self._chattering = Chattering(times[0], times[-1], settings.atol)
        self._systems: list[tuple[float, System]] = []
        """The systems that parts of the run are of, with the times (s) of their first outputs."""
        self._happened: list[EventRecord] = []
        self._whole: Trajectory | None = None
        self._cut: Restart | None = None
        """Restart before a step that the end of the run cut short and in which an event was found."""
        self.fastest: list[Real] = []
        """States in which bodies may have turned faster than their level describes, see `Raw`."""
        self.was_interrupted = False
        """Whether Ctrl-C ended the run; set when the run is over."""

    @property
    def doubts(self) -> list[str]:
        """Warnings about a run that reached its end."""
        return self._situation.doubts

    def __call__(self, begin: Beginning) -> Trajectory:
        """The trajectory of the run."""
        if begin.events is not None:
            self._sides.recall(begin.events)
        elif begin.memory is None and self._has_instants:
            start, due = unmoved(begin), self._agenda.due_at_start(begin.state.t)
            self._keep_leg(begin, start)
            instant = self._at_instant(start, due)
            if instant.ends:
                return self._over_after_events(instant)
            begin = self._situation.going_on(instant.raw)
        while True:
            starting = begin if self.course is None else begin._replace(y=begin.y.copy())
            segment = self._after_sample(self._next(begin))
            self._keep_leg(starting, segment.raw, segment.early)
            match segment.end:
                case SegmentEnd.TIME | SegmentEnd.FAILURE:
                    return self._over(segment.raw)
                case SegmentEnd.LEAP:
                    self._agenda.watch_again()
                case SegmentEnd.EVENT | SegmentEnd.SAMPLE:
                    speeds = begin.state.u, segment.raw.y[self._situation.speeds]
                    self._chattering.count(begin.state.t, segment.raw.t, speeds)
                case _:
                    assert_never(segment.end)
            instant = self._at_instant(segment.raw, segment.found, segment.levels, segment.early)
            if instant.ends or instant.raw.t >= self._times[-1]:
                return self._over_after_events(instant)
            if self._chattering.is_endless:
                return self._over_anew(instant.raw, ends=False)
            begin = self._situation.going_on(instant.raw)

    @property
    def _has_instants(self) -> bool:
        """Whether anything may happen between two steps."""
        return bool(self._situation.system.scene.events) or self._frictions is not None

    def _keep_leg(self, begin: Beginning, end: Raw, early: float = 0.0) -> None:
        """Append a part of the run to its course, before the events at its end change the system."""
        if self.course is not None:
            self.course.append(Leg(self._situation.system, begin, end._replace(y=end.y.copy()), [], [], early))

    def _next(self, begin: Beginning) -> Segment:
        """Integrate the next segment, append its outputs and update the sides to those at its end."""
        watched = self._agenda.watched
        segment = self._segments(begin)
        if segment.early:
            self._agenda.pass_over(segment.found, segment.raw.t, segment.early)
        self._join(segment.part)
        self.fastest += [segment.raw.fastest] if len(segment.raw.fastest) else []
        levels = segment.levels
        if levels is not None and levels.kept[0]:
            self._sides.take(watched, levels.kept_side, levels.kept_came)
            if segment.raw.paused:
                self._keep_cut(segment.raw)
        if levels is not None and (segment.raw.paused or not levels.kept[0]):
            self._sides.take(watched, levels.side, levels.came)
        return segment

    def _after_sample(self, segment: Segment) -> Segment:
        """Sampled controllers act at the end of the run's time, too: their outputs may trigger events there."""
        jumped = self._jumped(segment.raw) if segment.end is SegmentEnd.TIME else []
        return segment._replace(end=SegmentEnd.SAMPLE, found=jumped) if jumped else segment

    def _at_instant(
        self, raw: Raw, found: Sequence[SceneEvent], levels: Watch | None = None, early: float = 0.0
    ) -> AfterEvents:
        """Process one instant: first the events that were found, in the order of the scene, then bodies in contact with
        stops. Controllers that are due act later, when the next segment starts or the run ends.
        """
        y, before = self._situation.apart(raw.y)[0], len(self._happened)
        arrived = found if early else self._sides.arriving(raw, found, levels, y)
        for event in arrived:
            if event.name not in self._agenda.of_friction:
                records = self._situation.happen(event, raw, y)
                self._happened += [replace(record, early=early) for record in records]
            self._agenda.happened(event)
        self._settle(raw, [event.name for event in arrived], y, early)
        raw = self._situation.with_motion(raw, y)
        if self._whole is None:  # this is the start of the run
            self._sides.start(y)
        else:
            self._sides.move(raw, found, y)
        struck = self._stand(raw, found, y)
        if struck:
            self._settle(raw, (), y)
        raw = self._situation.with_motion(raw, y)
        self._agenda.take()  # coming to rest on a stop adds an event
        self._sides.make_known()
        ends = any(isinstance(action, EndRun) for event in (*arrived, *struck) for action in event.actions)
        if self.course:
            self.course[-1].events.extend((*arrived, *struck))
            self.course[-1].records.extend(self._happened[before:])
        return AfterEvents(raw, ends)

    def _settle(self, raw: Raw, found: Sequence[str], y: Real, early: float = 0.0) -> None:
        """Decide which friction sticks, see `flexmb.run.frictions`; found: names of events that happened."""
        if self._frictions is None:
            return
        is_start = self._whole is None
        records, changed = self._frictions.settle(raw, y, found)
        self._happened += [] if is_start else [replace(record, early=early) for record in records]
        if changed:
            self._agenda.take()
            self._sides.forget(event for name in changed for event in names_of(name))
            self._sides.make_known()

    def _stand(self, raw: Raw, found: Sequence[SceneEvent], y: Real) -> list[SceneEvent]:
        """Process bodies in contact with stops, see `flexmb.run.agenda`; returns the events that happened."""
        struck = []
        for event in self._agenda.watched:
            is_new = event not in found and self._sides.came[event.name] == 0
            if is_new and (self._whole is None or self._sides.side[event.name] in (0, UNKNOWN)):
                stood = stand(self._sides, event, raw, y)
                if stood is not None:
                    self._happened += stood.records
                    self._sides.side[event.name], self._sides.came[event.name] = stood.side, stood.came
                    struck += [event] * any(record.name == event.name for record in stood.records)
        return struck

    def _jumped(self, raw: Raw) -> list[SceneEvent]:
        """Events on outputs of sampled controllers that jumped at the end of the run."""
        events: list[SceneEvent] = []
        if raw.controllers is None:
            return events
        with self._situation.integration() as solve:
            assert solve.feedback is not None
            for event in self._agenda.watched:
                if self._sides.is_signal(event) and solve.feedback.is_sampled(event.watch):
                    height = raw.controllers.signal[solve.feedback.place_of(event.watch)] - event.level
                    side, direction = self._sides.side[event.name], DIRECTIONS[event.crossing]
                    if side in (-1, 1) and side * height < -self._sides.near(event) and side * direction <= 0:
                        events.append(event)
        return events

    def _over_after_events(self, instant: AfterEvents) -> Trajectory:
        """End the run at an instant of events: controllers that are due act after these, and events on the controllers'
        outputs follow."""
        raw, ends = instant
        if any(controller.period_s for controller in self._situation.system.scene.controllers):
            with self._situation.integration() as solve:
                assert solve.feedback is not None
                known = solve.feedback.look(self._situation.going_on(raw), acts=True, anew=True)
            raw = raw._replace(controllers=known)
            jumped = self._jumped(raw)
            if jumped:
                instant = self._at_instant(raw, jumped)
                raw, ends = instant.raw, ends or instant.ends
        return self._over_anew(raw, ends)

    def _over_anew(self, raw: Raw, ends: bool) -> Trajectory:
        """End the run after events: the state after them is one more output, and a run that resumes from here starts
        with an integrator without memory."""
        chatters = not ends and raw.t < self._times[-1]
        self._keep_leg(self._situation.going_on(raw), raw)
        last = raw._replace(states=raw.y[None], status=Status.CHATTERING if chatters else raw.status)
        with self._situation.integration() as solve:
            if solve.feedback is not None:
                solve.feedback.look(self._situation.going_on(raw), acts=False)
            part = self._situation.observed(last, np.array([raw.t]), solve)
        message = part.message
        if ends:
            message = f'ended by event "{self._happened[-1].name}" at t = {raw.t:g} s'
        elif chatters:
            names = dict.fromkeys(f'"{event.name}"' for event in self._happened[-FEW:])
            message = f"{message}; the last were {' and '.join(names)}"
        cost = {name: 0 for name in vars(part.statistics)}
        self._join(replace(part, message=message, statistics=replace(part.statistics, **cost)))
        return self._over(raw, anew=True, ends=ends, chatters=chatters)

    def _over(self, raw: Raw, anew: bool = False, ends: bool = False, chatters: bool = False) -> Trajectory:
        """The trajectory of the whole run; anew: whether events happened at its end."""
        assert self._whole is not None  # there was at least one segment
        self.was_interrupted = raw.interrupted
        can_go_on = not chatters and raw.status in CAN_GO_ON and raw.memory is not None
        # A resumed run finds events of the step that was cut short again, at instants that differ by the error of the
        # dense output. So they are recognised by their number, not by their times.
        shown = 0 if self._taken_up is None else self._taken_up.shown
        return told(
            self._whole,
            events=tuple(self._happened[shown:]),
            restart=self._restart_of(raw, raw.memory, ends, anew) if can_go_on else None,
            made_by=None if self._made_by is None else replace(self._made_by, altered=tuple(self._systems)),
        )

    def _restart_of(self, raw: Raw, memory: Memory, ends: bool, anew: bool) -> Restart:
        """The restart of a run that is over: before the step that the end of the run cut short, or at the end."""
        if self._cut is not None and self._cut.events is not None and not ends:
            shown = sum(record.t > self._cut.since for record in self._happened)
            return replace(self._cut, t=raw.t, events=self._cut.events._replace(shown=shown))
        if anew:
            memory = self._settings.integrator.memory(len(raw.y))
            memory.numbers[TIME] = memory.numbers[STRETCH] = raw.t
            memory.y[:] = raw.y
        return self._restart(raw, memory, anew)

    def _restart(self, raw: Raw, memory: Memory, anew: bool) -> Restart:
        scene, events = self._situation.system.scene, self._sides.remember(anew)
        return Restart(self._settings.method, scene, raw.t, memory, raw.controllers, events)

    def _keep_cut(self, raw: Raw) -> None:
        """Keep a restart before a step that the end of the run cut short and in which an event was found: a longer run
        takes the whole step, and finds the event at a time that differs by rounding."""
        if self._cut is None and raw.memory is not None:
            self._cut = self._restart(raw, raw.memory, anew=False)

    def _join(self, part: Trajectory) -> None:
        """Append outputs of the present system."""
        before = self._systems[-1][1] if self._systems else None
        if len(part.t) and self._situation.system is not before:
            self._systems.append((float(part.t[0]), self._situation.system))
        self._whole = part if self._whole is None else joined(self._whole, part)
