"""What a run with events knows where it is taken up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np

from flexmb.integrate.watch import RESTED, UNKNOWN
from flexmb.scene.schema import Scene
from flexmb.typing import Index

_KEY = "events_"  # before the names of its entries in a file


class EventMemory(NamedTuple):
    """By event (k,), in the order of the scene: side, came as in `flexmb.integrate.watch.Watch`, side of one on time 1
    where it has happened; passed 1 where it happened before its instant, within a leap, and is not watched up to the
    time `until` (s).

    anew: whether the integration begins anew, as it does after an event. ended (s): where the run ended; events before
    that are in its trajectory, and so many of those at that time as `shown` says. given: the scene whose coordinates
    come back where they are released, as changes alone have left it.
    """

    side: Index
    came: Index
    passed: Index
    until: float
    anew: bool
    ended: float
    shown: int
    given: Scene


def written(memory: EventMemory | None) -> dict[str, Any]:
    """Arrays for a file."""
    if memory is None:
        return {}
    plain = memory._asdict() | {"given": np.frombuffer(msgspec.json.encode(memory.given), np.uint8)}
    return {_KEY + name: value for name, value in plain.items()}


def read(file: Mapping[str, Any], scene: Scene) -> EventMemory | None:
    """Of a restart of this scene; None where it has no events. KeyError or ValueError for what is none."""
    if not scene.events:
        return None
    side, came, passed = (np.array(file[_KEY + name], np.int64) for name in ("side", "came", "passed"))
    for each, known in ((side, (-1, 0, 1, UNKNOWN)), (came, (-RESTED, -1, 0, 1, RESTED)), (passed, (0, 1))):
        if each.shape != (len(scene.events),) or not np.all(np.isin(each, known)):
            raise ValueError("sides of other events")
    until, ended, shown = float(file[_KEY + "until"]), float(file[_KEY + "ended"]), int(file[_KEY + "shown"])
    if np.isnan(until) or not np.isfinite(ended) or shown < 0:
        raise ValueError("no time or number of events")
    given = msgspec.json.decode(file[_KEY + "given"].tobytes(), type=Scene)
    return EventMemory(side, came, passed, until, bool(file[_KEY + "anew"]), ended, shown, given)
