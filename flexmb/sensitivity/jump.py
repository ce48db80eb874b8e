"""Derivatives across an instant at which events happen.

An event happens where g(t, y; p) = 0. Along a run its time t* changes by

    dt*/dp = -(g_y Y + g_p) / (g_y f + g_t),

with Y = dy/dp before it at fixed time. D = Y + f dt*/dp is the change of the state at the event. The event leads to
y+ = G(y; p), whose derivative along D is D+, and from then on the state at fixed time changes by Y+ = D+ - f+ dt*/dp,
with f and f+ the rates before and after it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, assert_never

import numpy as np

from flexmb.run.driver import Leg
from flexmb.scene.events import Action, Change, Dock, EndRun, Impact, Latch, Release, Separate
from flexmb.scene.schema import SceneEvent
from flexmb.sensitivity.impulses import Striking
from flexmb.sensitivity.law_rates import EventRates
from flexmb.sensitivity.leg import Course, Variation
from flexmb.sensitivity.part_scene import ChangeOfValue
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

# Step of the differences in time, relative to the part of the run: with Richardson's extrapolation their error is its
# fourth power, 1e-12 of the signal's variation over the part.
STEP = 1e-3
NEXT = 0.4  # of the distance to the nearest sampling instant, which no difference may cross


class Watched:
    """One number of a sensor or controller; the loops of the variation are replayed."""

    def __init__(self, variation: Variation, name: str) -> None:
        assert variation.loops is not None  # an event that watches a signal has them
        self._variation, self._loops = variation, variation.loops
        self._place = self._loops.place_of(name)
        self.is_sampled = self._loops.is_sampled(name)
        """Whether it is an output of a sampled controller, which changes at its instants only."""
        self._t = variation.leg.raw.t

    def change(self, end: Course) -> Real:
        """(P,) of the signal just before the events, at fixed time."""
        self._variation.take(end)
        _, rates = self._loops.look(self._loops.just_before(self._t))
        return np.asarray(rates[self._place])

    def rate(self, end: Course, before: Course) -> float:
        """Per second, along the motion: `before` are the rates of the state there."""
        h = STEP * (self._t - self._variation.leg.begin.state.t)
        near = self._loops.distance_to_instants(self._t)
        h = min(h, NEXT * near)

        def difference(h: float) -> float:
            ahead, behind = (self._value(end, before, side * h) for side in (1.0, -1.0))
            return (ahead - behind) / (2.0 * h)

        return (4.0 * difference(0.5 * h) - difference(h)) / 3.0

    def _value(self, end: Course, before: Course, later: float) -> float:
        """The signal where the motion leads in a straight line; the bend of its path cancels in central differences."""
        self._variation.take(Course(end.y + later * before.y, np.zeros_like(end.Y)))
        return float(self._loops.look(self._t + later)[0][self._place])


SAME = 1e-9  # times of simultaneous events may have derivatives that differ by this, relative to the larger one
GRAZING = 1e-6  # a crossing whose time changes by more than this times the run's for a change within tolerance
REST = ": at rest"


class Crossing(NamedTuple):
    """An event before its actions: dt (P,) is the scaled derivative of its time."""

    event: SceneEvent
    dt: Real


class Jumped(NamedTuple):
    """Times of events with their scaled derivatives, D+ (n,P) after them, and what they hold from then on (P,)."""

    crossings: list[Crossing]
    dt: Real
    D: Real
    held: dict[str, Real]
    changes: list[ChangeOfValue]


class EventError(DynamicsError):
    """A run has no derivative beyond an event, or none that is known."""


def jumped(
    variation: Variation, end: Course, rates: Mapping[str, EventRates], held: Mapping[str, Real], tolerance: Real
) -> Jumped:
    """What the events at the end of a part of a run do to derivatives.

    end: its state, before the events. rates: of levels and restitutions by event. held: scaled derivatives of the
    values at which coordinates are held. tolerance: atol, rtol and the length of the run (s).
    """
    leg, t = variation.leg, variation.leg.raw.t
    _refuse(leg)
    P = end.Y.shape[1]
    is_fixed = all(not _moves(event) and not np.any(_level(event, rates, P)) for event in leg.events)
    before = None if is_fixed else variation.slope(np.nextafter(t, -np.inf), end)
    crossings = [Crossing(event, _time(variation, end, before, event, rates, tolerance)) for event in leg.events]
    dt = crossings[0].dt if crossings else np.zeros(P)
    for crossing in crossings[1:]:
        if np.max(np.abs(crossing.dt - dt)) > SAME * np.max(np.abs(np.concatenate([dt, crossing.dt]))):
            raise EventError(
                f'events "{crossings[0].event.name}" and "{crossing.event.name}" happen at one instant, t = {t:g} s, '
                "but their times change differently with the parameters: which comes first changes what follows, so "
                "that the run has no derivative beyond; move one of them"
            )
    D = end.Y if before is None else end.Y + np.outer(before.y, dt)
    held, changes = dict(held), list[ChangeOfValue]()
    striking = Striking(variation, end.y, held)
    for event in leg.events:
        for i, action in enumerate(event.actions):
            own = rates[event.name].restitution.get(i) if event.name in rates else None
            D = _acted(striking, action, D, own, held)
            if isinstance(action, Change):
                changes.append(ChangeOfValue(event.name, i))
    return Jumped(crossings, dt, D, held, changes)


def _acted(striking: Striking, action: Action, D: Real, restitution: Real | None, held: dict[str, Real]) -> Real:
    """The change of the state after an action along D (n,P)."""
    match action:
        case Latch(coordinate=name):
            D = striking.struck(D, name, 0.0, np.zeros(D.shape[1]))
            held[name] = D[striking.place(name)].copy()
            return D
        case Impact(coordinate=name, restitution=factor):
            assert restitution is not None  # of every event of the scene
            return striking.struck(D, name, -factor, -restitution)
        case Release(coordinate=name):
            held.pop(name, None)
            striking.free(name)
            return D
        case Change() | Separate() | EndRun():
            return D
        case Dock(closure=name):
            raise NotImplementedError(
                f'an event closes closure "{name}": derivatives through an impulse that closes a closure are not '
                "available; end the run before it, and give what follows as a scene that starts in the state after it"
            )
        case _:
            assert_never(action)


def _refuse(leg: Leg) -> None:
    """EventError for events after which no derivative is known."""
    t = leg.raw.t
    for record in leg.records:
        if record.name.endswith(REST):
            raise EventError(
                f'at t = {t:g} s "{record.name.removesuffix(REST)}" comes to rest, after rebounds that become too '
                "small to be told apart: derivatives end here; end the run before, or latch the coordinate by an event "
                "of its own"
            )
    if leg.early:
        raise EventError(
            f'event "{leg.events[0].name}" at t = {t:g} s lies near a singular position of a closed chain, where it '
            "has no derivative; move the event"
        )
    changes = [isinstance(action, Change) for event in leg.events for action in event.actions]
    strikes = [isinstance(action, Latch | Impact) for event in leg.events for action in event.actions]
    if any(changes) and any(strikes):
        raise NotImplementedError(
            f"at t = {t:g} s a value of the scene changes at the same instant as a latch or an impact: derivatives "
            "need them at two instants; let one happen a moment later"
        )


def _moves(event: SceneEvent) -> bool:
    """Whether the time of an event follows from the motion."""
    return event.watch != "time"


def _level(event: SceneEvent, rates: Mapping[str, EventRates], P: int) -> Real:
    """The scaled derivative (P,) of the level of an event."""
    return rates[event.name].level if event.name in rates else np.zeros(P)


def _time(
    variation: Variation, end: Course, before: Course | None, event: SceneEvent, rates: Mapping[str, EventRates],
    tolerance: Real,
) -> Real:  # fmt: skip
    """The scaled derivative (P,) of the time of an event."""
    level = _level(event, rates, end.Y.shape[1])
    if not _moves(event):
        return level
    assert before is not None
    system, t = variation.blocks.system, variation.leg.raw.t
    names = [name for names in system.state_names for name, _ in names]
    if event.watch in names:
        place = names.index(event.watch)
        rate, change = float(before.y[place]), end.Y[place]
    else:
        watched = Watched(variation, event.watch)
        if watched.is_sampled:  # it jumps at a sampling instant, which stays where it is
            return np.zeros(end.Y.shape[1])
        rate, change = watched.rate(end, before), watched.change(end)
    atol, rtol, length = tolerance
    if abs(rate) * GRAZING * length <= atol + rtol * abs(event.level):
        raise EventError(
            f'event "{event.name}" at t = {t:g} s grazes its level: the quantity reaches it at {rate:.1e} per second, '
            f"too slowly for its time to have a derivative at rtol {rtol:g}: take a smaller rtol, or change the level "
            "or the motion"
        )
    return (level - change) / rate
