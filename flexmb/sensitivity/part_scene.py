"""The scene of each part of a run as a function of the numbers of the run's own scene.

Events change values of the scene. The new values are numbers of the scene themselves, those of `Change` actions, so
that in a part of a run a number acts through its own place, unless a change has overwritten it, and through the places
that changes have written it to. What events hold and release stays as it is: the values at which coordinates are held
follow from the motion, and their derivatives come from there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import msgspec

from flexmb.parameters.numbers import Number
from flexmb.scene.events import Change
from flexmb.scene.schema import Scene

_STEADY = {"controllers", "events", "sensors"}
"""Collections on which the tables of the mechanics do not depend."""


class ChangeOfValue(NamedTuple):
    """A `Change` action: the name of its event, and its number among the actions there."""

    event: str
    action: int


class PartScene:
    """The scene in a part of a run, with other values of numbers of the run's own scene."""

    def __init__(self, given: Scene, changes: Sequence[ChangeOfValue], now: Scene) -> None:
        """given: the run's own scene; changes: those that have happened, in order; now: what all events have made."""
        self._given, self._changes, self.now = given, tuple(changes), now
        self._base = changed(given, changes)

    def scene_with(self, values: Mapping[str, float]) -> Scene:
        """The scene of the part with other values, by name of the number."""
        scene: Scene = _carried(self._base, self.now, changed(self._given.with_values(values), self._changes))
        return scene

    def is_mechanical(self, number: Number) -> bool:
        """Whether the mechanics of the part may depend on a number. Of a coordinate that is held they may not, though
        its own initial value counts: tables that are known by the same numbers can be taken over."""
        other = self._given.with_values({number.name: number.nearby_value})
        return differ_in_mechanics(self._base, changed(other, self._changes))


class PartNumber(Number):
    """A number of a run's own scene, with the scene of a part of the run as a function of it."""

    def __init__(self, number: Number, part: PartScene) -> None:
        self.name, self.value, self._scene, self.part = number.name, number.value, number.own_scene, part

    def scene_with(self, values: Mapping[str, float]) -> Scene:
        """See `Number.scene_with`."""
        return self.part.scene_with(values)


def all_changes(scene: Scene) -> Iterator[ChangeOfValue]:
    """Every `Change` action of a scene."""
    for event in scene.events:
        for i, action in enumerate(event.actions):
            if isinstance(action, Change):
                yield ChangeOfValue(event.name, i)


def changed(scene: Scene, changes: Sequence[ChangeOfValue]) -> Scene:
    """The scene after changes, with the values that its own events have."""
    events = {event.name: event for event in scene.events}
    for name, i in changes:
        action = events[name].actions[i]
        assert isinstance(action, Change)  # what a `ChangeOfValue` names
        scene = scene.with_values({action.path: action.value})
    return scene


def differ_in_mechanics(one: Scene, other: Scene) -> bool:
    """Whether the tables of the mechanics of two scenes may differ."""
    return any(getattr(one, key) != getattr(other, key) for key in one.__struct_fields__ if key not in _STEADY)


def _carried(base: Any, now: Any, other: Any) -> Any:
    """What `now` has become from `base`, from `other` in place of `base`. What differs from it both ways is as `now`
    has it: values that events have set do not depend on the scene's own ones."""
    if now is base or now == base:
        return other
    if other is base or other == base:
        return now
    if isinstance(base, msgspec.Struct) and type(base) is type(now) is type(other):
        parts = {
            key: _carried(*(getattr(scene_of_part, key) for scene_of_part in (base, now, other)))
            for key in base.__struct_fields__
        }
        return msgspec.structs.replace(now, **parts)
    if isinstance(base, tuple) and len(base) == len(other) <= len(now):  # events may have added some at its end
        kept = (_carried(*items) for items in zip(base, now[: len(base)], other, strict=True))
        return (*kept, *now[len(base) :])
    return now
