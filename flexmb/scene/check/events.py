"""Events: something to watch that there is, and actions that can be done."""

from __future__ import annotations

from collections.abc import Iterator

from flexmb.scene.check.control import named, one_number, widths_of
from flexmb.scene.check.walk import sound
from flexmb.scene.events import Change, Impact, Latch, Release
from flexmb.scene.problems import Defect, Place, closest
from flexmb.scene.schema import Scene, SceneEvent
from flexmb.scene.tree import scalar_paths, watchable
from flexmb.scene.values import PathError, with_values


def events(scene: Scene) -> Iterator[Defect]:
    """Every event watches something, and does something that can be done."""
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


def _signal(
    place: Place, reference: str, signals: dict[str, int | None], others: dict[str, str]
) -> Iterator[Defect]:
    """What is no time, coordinate or rate is one number of a sensor or controller."""
    found = named(reference)
    if found is None or found.name not in signals:
        yield Defect(str(place), f'there is no "{reference}"', closest(reference, {**others, **signals}))
    else:
        yield from one_number(place, reference, signals)


def _actions(scene: Scene, place: Place, event: SceneEvent, paths: dict[str, str]) -> Iterator[Defect]:
    for i, action in enumerate(event.actions):
        spot = place.key("actions", i)
        if isinstance(action, Latch | Release | Impact) and action.coordinate not in paths:
            what = f'there is no scalar coordinate "{action.coordinate}"'
            yield Defect(str(spot.key("coordinate")), what, closest(action.coordinate, paths))
        if isinstance(action, Impact) and not 0.0 <= action.restitution <= 1.0:
            what = f"the restitution is {action.restitution:g}"
            yield Defect(str(spot.key("restitution")), what, "from 0 (no rebound) to 1 (no loss)")
        if isinstance(action, Change):
            yield from _change(scene, spot, action)


def _change(scene: Scene, place: Place, action: Change) -> Iterator[Defect]:
    first, *rest = action.path.split(".")
    if first in ("name", "events") or (rest and rest[-1] == "name"):
        yield Defect(str(place.key("path")), f'"{action.path}" stays as it is in a run', "change values, not names")
        return
    try:
        with_values(scene, {action.path: action.value})
    except PathError as problem:
        yield Defect(str(place), str(problem), "see Scene.with_values")
