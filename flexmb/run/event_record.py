"""The record of an event that happened in a run, and the state of a scene's events at its end, from which the run can
be resumed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec
import numpy as np

from flexmb.integrate.watch import RESTED, UNKNOWN
from flexmb.scene.check import check_scene
from flexmb.scene.schema import Scene
from flexmb.scene.sticking import events_of
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.tables.state import State
from flexmb.typing import Index, Real


@dataclass(frozen=True)
class EventRecord:
    """An event that happened at t (s).

    impulses: by coordinate, the impulse of its hinge or wheel along it (N s or N m s), also of coordinates that are
    held. energy_change (J) is included in the work of the trajectory. before, after: the states. closures: by closure,
    its impulse (6,) [N m s; N s] on body_b about frame B, World axes. Impulses that redundant closures leave
    undetermined are NaN. early (s): how long before its instant the event happened; it is not zero only if the instant
    lies near a singular position of a closed chain. misfits: by closure that was closed, how far its frames were apart
    before, (m, rad) along and about what it suppresses.
    """

    name: str
    t: float
    impulses: dict[str, float]
    energy_change: float
    before: State
    after: State
    closures: dict[str, Real] = field(default_factory=dict)
    early: float = 0.0
    misfits: dict[str, tuple[float, float]] = field(default_factory=dict)

    __repr__ = brief


_KEY = "events_"  # prefix of the names of its arrays in a file
SIDES, CAMES = (-1, 0, 1, UNKNOWN), (-RESTED, -1, 0, 1, RESTED)
MOST = 2**53  # the largest count that a float represents exactly


class EventMemory(NamedTuple):
    """By event (k,), in the order of the scene: side and came are as in `flexmb.integrate.watch.Watch`, but the side of
    an event on time is 1 once it has happened; passed is 1 for an event that happened before its instant, within a
    leap, and is not watched until the time `until` (s).

    anew: whether the integrator restarts without memory, as it does after an event. shown: the number of events that
    the resumed run finds again, because they lie in a step that the end of the run cut short, although the trajectory
    contains them already. given: the scene altered by changes of values alone, without latches; a coordinate that is
    released is again what it is there.
    """

    side: Index
    came: Index
    passed: Index
    until: float
    anew: bool
    shown: int
    given: Scene


NAMES = tuple(_KEY + name for name in EventMemory._fields)
"""Names of its arrays in a file."""


def written(memory: EventMemory | None) -> dict[str, Any]:
    """The arrays to be stored in a file, by name."""
    if memory is None:
        return {}
    given = np.frombuffer(msgspec.json.encode(memory.given), np.uint8)
    return dict(zip(NAMES, memory._replace(anew=int(memory.anew), given=given), strict=True))  # type: ignore[arg-type]


def read(file: Mapping[str, Any]) -> EventMemory:
    """What a file contains, not yet validated; KeyError for a missing array, ValueError for one of the wrong form."""
    side, came, passed, *numbers, given = (file[name] for name in NAMES)
    until, anew, shown = (number.item() for number in numbers)
    if anew not in (0, 1):
        raise ValueError(f"{_KEY}anew is {anew:g}, but must be 0 or 1")
    scene = msgspec.json.decode(given.tobytes(), type=Scene)
    return EventMemory(side, came, passed, until, bool(anew), shown, scene)


def examined(memory: EventMemory, scene: Scene) -> EventMemory:
    """A validated copy; ValueError or TypeError for values that no run of this scene can have left."""
    events, rows = len(events_of(scene)), dict[str, Index]()
    for name, known in (("side", SIDES), ("came", CAMES), ("passed", (0, 1))):
        row = arguments.shaped(name, getattr(memory, name), (events,))
        if not np.all(np.isin(row, known)):
            raise ValueError(f"{name} of the events is {row}, but each must be one of {known}")
        rows[name] = row.astype(np.int64)
    shown = arguments.number("shown", memory.shown)
    if not isinstance(memory.until, float) or math.isnan(memory.until):
        raise ValueError(f"until is {memory.until!r}, but must be a time (s) or -inf")
    if not isinstance(memory.anew, bool) or not isinstance(memory.given, Scene):
        raise TypeError("anew must be True or False, and given must be a Scene")
    if not 0.0 <= shown <= MOST or shown != int(shown):
        raise ValueError(f"shown is {shown:g}, but must be a number of events")
    if _items(memory.given) != _items(scene):
        raise ValueError("the scene in `given` has other bodies or hinges than the scene of the run")
    check_scene(memory.given)
    return EventMemory(**rows, until=memory.until, anew=memory.anew, shown=int(shown), given=memory.given)


def _items(scene: Scene) -> set[tuple[str, str, str]]:
    """List, kind and name of a scene's items, which latches and changes of values keep; without sensors and events,
    because coming to rest on a stop adds some."""
    lists = {name: getattr(scene, name) for name in scene.__struct_fields__ if name not in ("sensors", "events")}
    return {
        (name, type(item).__name__, getattr(item, "name", ""))
        for name, items in lists.items()
        if isinstance(items, tuple)
        for item in items
        if isinstance(item, msgspec.Struct)
    }
