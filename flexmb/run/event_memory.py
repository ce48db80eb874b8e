"""What a run with events knows where it is taken up."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import msgspec
import numpy as np

from flexmb.integrate.watch import RESTED, UNKNOWN
from flexmb.scene.check import check_scene
from flexmb.scene.schema import Scene
from flexmb.tables import arguments
from flexmb.typing import Index

_KEY = "events_"  # before the names of its entries in a file
SIDES, CAMES = (-1, 0, 1, UNKNOWN), (-RESTED, -1, 0, 1, RESTED)
MOST = 2**53  # that a number can count


class EventMemory(NamedTuple):
    """By event (k,), in the order of the scene: side, came as in `flexmb.integrate.watch.Watch`, side of one on time 1
    where it has happened; passed 1 where it happened before its instant, within a leap, and is not watched up to the
    time `until` (s).

    anew: whether the integration begins anew, as it does after an event. shown: how many events happen again, in steps
    that the end of the run has cut short, which are in its trajectory already. given: the scene whose coordinates come
    back where they are released, as changes alone have left it.
    """

    side: Index
    came: Index
    passed: Index
    until: float
    anew: bool
    shown: int
    given: Scene


NAMES = tuple(_KEY + name for name in EventMemory._fields)
"""Of its arrays in a file."""


def written(memory: EventMemory | None) -> dict[str, Any]:
    """Arrays for a file."""
    if memory is None:
        return {}
    given = np.frombuffer(msgspec.json.encode(memory.given), np.uint8)
    return dict(zip(NAMES, memory._replace(anew=int(memory.anew), given=given), strict=True))  # type: ignore[arg-type]


def read(file: Mapping[str, Any]) -> EventMemory:
    """What a file says, to be examined; KeyError for what it lacks, ValueError for what is nothing of the kind."""
    side, came, passed, *numbers, given = (file[name] for name in NAMES)
    until, anew, shown = (each.item() for each in numbers)
    if anew not in (0, 1):
        raise ValueError(f"{_KEY}anew is {anew:g}, and is 0 or 1")
    scene = msgspec.json.decode(given.tobytes(), type=Scene)
    return EventMemory(side, came, passed, until, bool(anew), shown, scene)


def examined(memory: EventMemory, scene: Scene) -> EventMemory:
    """A copy that runs of this scene may have left; ValueError or TypeError where none has."""
    events, rows = len(scene.events), dict[str, Index]()
    for name, known in (("side", SIDES), ("came", CAMES), ("passed", (0, 1))):
        row = arguments.shaped(name, getattr(memory, name), (events,))
        if not np.all(np.isin(row, known)):
            raise ValueError(f"{name} of the events is {row}, and each is one of {known}")
        rows[name] = row.astype(np.int64)
    shown = arguments.number("shown", memory.shown)
    if not isinstance(memory.until, float) or math.isnan(memory.until):
        raise ValueError(f"until is {memory.until!r}, and is a time, or -inf")
    if not isinstance(memory.anew, bool) or not isinstance(memory.given, Scene):
        raise TypeError("anew is True or False, given a scene")
    if not 0.0 <= shown <= MOST or shown != int(shown):
        raise ValueError(f"shown is {shown:g}, and counts events")
    if _items(memory.given) != _items(scene):
        raise ValueError("what changes have left of the scene has other bodies or hinges than the scene")
    check_scene(memory.given)
    return EventMemory(**rows, until=memory.until, anew=memory.anew, shown=int(shown), given=memory.given)


def _items(scene: Scene) -> set[tuple[str, str, str]]:
    """By list, kind and name what neither latches nor changes of values alter; stops add sensors and events."""
    lists = {name: getattr(scene, name) for name in scene.__struct_fields__ if name not in ("sensors", "events")}
    return {
        (name, type(item).__name__, getattr(item, "name", ""))
        for name, items in lists.items()
        if isinstance(items, tuple)
        for item in items
        if isinstance(item, msgspec.Struct)
    }
