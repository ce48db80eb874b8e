"""Bodies in contact with a stop at the start of a run, or when they are released there.

A stop is an event with an `Impact` that watches a coordinate or signal, not a rate. A body in contact with it does not
cross its level, so the search for crossings within steps does not find it. A body is in contact if its distance is
within the tolerance of the run. Its side is the one from which `crossing` says that it arrives; for a stop that is hit
from either side, the side from which loads press the body against it, or without loads the one from which it moves. If
the body moves into the stop, the impact happens. If it is at rest and pressed against the stop, it comes to rest if the
stop `rests`; otherwise the event happens as soon as it drifts past the level. In all other cases it leaves the stop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.run.event_record import EventRecord
from flexmb.run.event_sides import DIRECTIONS, Sides
from flexmb.run.propagate import Raw
from flexmb.run.situation import Situation
from flexmb.scene.events import Impact
from flexmb.scene.schema import SceneEvent
from flexmb.typing import Real


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
