"""Rest on a stop, as scenes say it: a coordinate that is held, and an event that releases it before the stop pulls."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec.structs import replace

from flexmb.scene.control import DriveSensor
from flexmb.scene.events import Impact, Release
from flexmb.scene.schema import Scene, SceneEvent


def with_stops(scene: Scene) -> Scene:
    """The scene with a sensor for the load of every stop on which something may come to rest."""
    known = {sensor.name for sensor in scene.sensors}
    stops = [DriveSensor(name=load_of(event), coordinate=action.coordinate) for event, action in _resting(scene)]
    return replace(scene, sensors=(*scene.sensors, *(each for each in stops if each.name not in known)))


def _resting(scene: Scene) -> Iterator[tuple[SceneEvent, Impact]]:
    for event in scene.events:
        for action in event.actions:
            if isinstance(action, Impact) and action.rests:
                yield event, action


def load_of(event: SceneEvent) -> str:
    """The name of the signal that is the load of its stop, along the coordinate (N or N m)."""
    return f"{event.name}: stop"


def leaving(event: SceneEvent) -> str:
    """The name of the event by which what rests on its stop leaves it."""
    return f"{event.name}: leaves"


def on_stop(scene: Scene, event: SceneEvent, coordinate: str, push: int) -> Scene:
    """The scene, its coordinate held, with an event that releases it; push: the sign of loads of the stop."""
    leaves = SceneEvent(
        name=leaving(event), watch=load_of(event), level=0.0, crossing="falling" if push > 0 else "rising",
        actions=(Release(coordinate=coordinate),),
    )  # fmt: skip
    return replace(scene, events=(*scene.events, leaves))


def off_stop(scene: Scene, event: SceneEvent) -> Scene:
    """The scene after an event: without it, if it was one by which something left its stop."""
    stops = {leaving(each) for each, _ in _resting(scene)}
    if event.name not in stops:
        return scene
    return replace(scene, events=tuple(each for each in scene.events if each.name != event.name))
