"""Rest on a stop as part of a scene: the coordinate is held, and an event releases it before the stop would pull."""

from __future__ import annotations

from msgspec.structs import replace

from flexmb.scene.schema import Scene, SceneEvent
from flexmb.scene.stops import leaves, leaving, resting, stop_sensor


def with_stops(scene: Scene) -> Scene:
    """The scene with a sensor for the load of every stop on which something may come to rest."""
    known = {sensor.name for sensor in scene.sensors}  # the scene of a resumed run has these sensors already
    stops = [stop_sensor(event, action) for event, action in resting(scene)]
    return replace(scene, sensors=(*scene.sensors, *(each for each in stops if each.name not in known)))


def on_stop(scene: Scene, event: SceneEvent, coordinate: str, push: int) -> Scene:
    """The scene, in which the coordinate is held, with an event that releases it; push: sign of the stop's load."""
    return replace(scene, events=(*scene.events, leaves(event, coordinate, push)))


def off_stop(scene: Scene, event: SceneEvent) -> Scene:
    """The scene after an event: without it, if it was one that released a coordinate from its stop."""
    stops = {leaving(each) for each, _ in resting(scene)}
    if event.name not in stops:
        return scene
    return replace(scene, events=tuple(each for each in scene.events if each.name != event.name))
