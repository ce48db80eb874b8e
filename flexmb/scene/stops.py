"""Stops on which something may come to rest: the names that a run gives to their loads and to leaving them."""

from __future__ import annotations

from collections.abc import Iterator

from flexmb.scene.control import DriveSensor
from flexmb.scene.events import Impact, Release
from flexmb.scene.schema import Scene, SceneEvent


def resting(scene: Scene) -> Iterator[tuple[SceneEvent, Impact]]:
    """Events by which something may come to rest, each with the impact that lets it."""
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


def stop_sensor(event: SceneEvent, action: Impact) -> DriveSensor:
    """What measures the load of a stop."""
    return DriveSensor(name=load_of(event), coordinate=action.coordinate)


def leaves(event: SceneEvent, coordinate: str, push: int) -> SceneEvent:
    """The event by which what rests on a stop leaves it; push: the sign of loads of the stop."""
    return SceneEvent(
        name=leaving(event), watch=load_of(event), level=0.0, crossing="falling" if push > 0 else "rising",
        actions=(Release(coordinate=coordinate),),
    )  # fmt: skip
