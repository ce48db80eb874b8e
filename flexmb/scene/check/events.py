"""Checks of events: the watched signal exists, and the actions are possible."""

from __future__ import annotations

from collections.abc import Iterator

from flexmb.scene.check.control import named, one_number, widths_of
from flexmb.scene.check.walk import entries, sound
from flexmb.scene.events import Change, Dock, Impact, Latch, Release, Separate
from flexmb.scene.problems import Defect, Place, closest
from flexmb.scene.schema import Scene, SceneEvent
from flexmb.scene.stops import leaves, leaving, load_of, resting, stop_sensor
from flexmb.scene.tree import scalar_paths, watchable
from flexmb.scene.values import PathError, with_values


def events(scene: Scene) -> Iterator[Defect]:
    """Every event watches an existing signal, and its actions are possible; what is open may close."""
    yield from _open_closures(scene)
    if not scene.events:
        return
    paths = scalar_paths(scene)
    watched, signals = watchable(scene), widths_of(scene)
    for place, event in sound(scene, "events"):
        if event.watch not in watched:
            yield from _signal(place.key("watch"), event.watch, signals, watched)
        if watched.get(event.watch) == "time" and event.crossing == "falling":
            yield Defect(str(place.key("crossing")), "time does not fall", "leave the crossing out")
        if not event.actions:
            yield Defect(str(place.key("actions")), "nothing happens", "give at least one action, or leave it out")
        yield from _actions(scene, place, event, paths)
        if sum(isinstance(action, Impact) and action.rests for action in event.actions) > 1:
            what = "more than one stop is to rest on: their loads would have the same name"
            yield Defect(str(place.key("actions")), what, "give each stop an event of its own")
    yield from _names_of_stops(scene)


def _open_closures(scene: Scene) -> Iterator[Defect]:
    """A closure that is open is one that events open or close: a scene without events is the same at all times."""
    actions = [action for _, event in sound(scene, "events") for action in event.actions]
    named_by_events = {action.closure for action in actions if isinstance(action, Separate | Dock)}
    for place, closure in sound(scene, "closures"):
        if not closure.closed and closure.name not in named_by_events:
            what, remedy = "it is open, and no event closes it", "give an event with a dock action, or leave it out"
            yield Defect(str(place.key("closed")), what, remedy)


def _names_of_stops(scene: Scene) -> Iterator[Defect]:
    """The names that a run gives to the loads of stops and to release events are not used otherwise in the scene."""
    loads = {load_of(event): (event, stop_sensor(event, action)) for event, action in resting(scene)}
    for collection in ("sensors", "controllers") if loads else ():
        for place, item in entries(scene, collection):
            event, sensor = loads.get(item.name, (None, item))
            if item != sensor:
                assert event is not None  # whose stop it is
                what = f'"{item.name}" is the load of the stop of event "{event.name}", which a run adds'
                yield Defect(str(place.key("name")), what, "rename one of the two")
    going = {leaving(event): (event, action.coordinate) for event, action in resting(scene)}
    for place, each in entries(scene, "events") if going else ():
        if each.name in going:
            event, coordinate = going[each.name]
            if each not in [leaves(event, coordinate, push) for push in (1, -1)]:
                what = f'"{each.name}" is what a run calls it when something leaves the stop of event "{event.name}"'
                yield Defect(str(place.key("name")), what, "rename one of the two")


def _signal(place: Place, reference: str, signals: dict[str, int | None], others: dict[str, str]) -> Iterator[Defect]:
    """A reference to anything but time, coordinates and rates is to one number of a sensor or controller."""
    names = named(reference)
    if names is None or names.name not in signals:
        yield Defect(str(place), f'there is no "{reference}"', closest(reference, {**others, **signals}))
    else:
        yield from one_number(place, reference, signals)


def _actions(scene: Scene, place: Place, event: SceneEvent, paths: dict[str, str]) -> Iterator[Defect]:
    for i, action in enumerate(event.actions):
        spot = place.key("actions", i)
        if isinstance(action, Latch | Release | Impact) and action.coordinate not in paths:
            what = f'there is no scalar coordinate "{action.coordinate}"'
            yield Defect(str(spot.key("coordinate")), what, closest(action.coordinate, paths))
        if isinstance(action, Separate | Dock):
            closures = [closure.name for closure in scene.closures]
            if action.closure not in closures:
                what = f'there is no closure "{action.closure}"'
                yield Defect(str(spot.key("closure")), what, closest(action.closure, closures))
        if isinstance(action, Change):
            yield from _change(scene, spot, action)


def _change(scene: Scene, place: Place, action: Change) -> Iterator[Defect]:
    what = f'"{action.path}" stays as it is in a run'
    fixed = Defect(str(place.key("path")), what, "change values, not names or events")
    first, *rest = action.path.split(".")
    if first in ("name", "events") or (rest and rest[-1] == "name"):
        yield fixed
        return
    try:
        other = with_values(scene, {action.path: action.value})
    except PathError as problem:
        yield Defect(str(place), str(problem), "see Scene.with_values")
        return
    if other.events != scene.events:  # a path may begin with the name of an event
        yield fixed
