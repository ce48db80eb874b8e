"""What stands on a stop where a run begins, or is let go there: it has not come to the stop, and is held by it.

A stop is an event with an `Impact` that watches a place. Nothing arrives at a stop on which it already is, so nothing
that watches steps would stop it. A body is on a stop where it is nearer than the error that the run allows, on the side
from which `crossing` says that it comes; of a stop that is hit from either side, where the loads press against it, or
without loads where the body moves to. What moves into the stop is struck. What is at rest and pressed rests, where the
stop `rests`; else it is seen to come to it as soon as it drifts. Everything else leaves.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexmb.run.event_record import EventRecord
from flexmb.run.situation import Accelerations, Situation
from flexmb.scene.events import Impact
from flexmb.scene.schema import SceneEvent
from flexmb.typing import Real

Probe = Callable[[SceneEvent, float, Real], tuple[float, float]]
"""Height of what an event watches above its level, and its rate, at a time (s) and y = [q, u, work]."""
_FROM = {"falling": 1, "rising": -1, "either": 0}


class Stood(NamedTuple):
    """What happened at a stop, and from then on its `side` and `came` as in `flexmb.integrate.watch.Watch`."""

    records: list[EventRecord]
    side: int
    came: int


def stops(situation: Situation, event: SceneEvent) -> Impact | None:
    """The impact of an event that watches a place: not time, nor the rate of a coordinate."""
    is_place = event.watch != "time" and (
        event.watch not in situation.places or situation.rate_of(event.watch) is not None
    )
    impacts = [action for action in event.actions if isinstance(action, Impact)]
    return impacts[0] if is_place and impacts else None


def stand(
    situation: Situation, event: SceneEvent, t: float, y: Real, near: float, probe: Probe, accelerations: Accelerations
) -> Stood | None:
    """Whether something stands on a stop, and what becomes of it; what happens changes y in place. None if it does not.

    near: so far from its level it is at it.
    """
    impact = stops(situation, event)
    if impact is None or situation.is_held(event.watch) or situation.is_held(impact.coordinate):
        return None
    height, rate = probe(event, t, y)
    if abs(height) > near:
        return None
    speed = situation.speed(impact.coordinate, y)
    towards = int(np.sign(rate)) if speed else 0
    pressed, falls = _pressed(situation, event, impact, t, y, probe, accelerations)
    side = _FROM[event.crossing] or -pressed or towards
    if side * towards < 0:
        _put(situation, event, y)
        records = situation.happen(event, t, y, accelerations)
        moves = situation.speed(impact.coordinate, y) != 0.0 and not situation.is_held(impact.coordinate)
        return Stood(records, side if moves else 0, 0 if moves or situation.is_held(impact.coordinate) else side)
    if side * towards > 0:
        return Stood([], side, 0)
    if side * pressed >= 0:
        return Stood([], 0, side)
    _put(situation, event, y)
    if impact.rests:
        return Stood([situation.rest(event, impact, -falls, t, y)], 0, 0)
    return Stood([], 0, side)


def _pressed(
    situation: Situation, event: SceneEvent, impact: Impact, t: float, y: Real, probe: Probe,
    accelerations: Accelerations,
) -> tuple[int, int]:  # fmt: skip
    """Signs of the ways that what is watched, and the coordinate, would take from rest, if there were no stop."""
    still = situation.at_rest(impact.coordinate, t, y)
    gained, moving = accelerations(t, still), still.copy()
    moving[situation.system.nq : -1], still[situation.system.nq : -1] = gained, 0.0
    _, ahead = probe(event, t, moving)
    _, before = probe(event, t, still)
    return int(np.sign(ahead - before)), int(np.sign(situation.speed(impact.coordinate, moving)))


def _put(situation: Situation, event: SceneEvent, y: Real) -> None:
    """Coordinates are put at their level exactly, as where they arrive."""
    if event.watch in situation.places:
        y[situation.places[event.watch]] = event.level
