"""Stops on which a coordinate can come to rest: their load signals, and the events that end the contact."""

from __future__ import annotations

from collections.abc import Iterator

from flexmb.scene.control import DriveSensor
from flexmb.scene.events import Impact, Release
from flexmb.scene.schema import Scene, SceneEvent


def resting(scene: Scene) -> Iterator[tuple[SceneEvent, Impact]]:
    """Events with an impact after which a coordinate may come to rest, each with this impact."""
    for event in scene.events:
        for action in event.actions:
            if isinstance(action, Impact) and action.rests:
                yield event, action


def load_of(event: SceneEvent) -> str:
    """The name of the signal with the load of the stop along the coordinate (N or N m)."""
    return f"{event.name}: stop"


def leaving(event: SceneEvent) -> str:
    """The name of the event that ends the contact."""
    return f"{event.name}: leaves"


def stop_sensor(event: SceneEvent, action: Impact) -> DriveSensor:
    """The sensor of the load of a stop."""
    return DriveSensor(name=load_of(event), coordinate=action.coordinate)


def leaves(event: SceneEvent, coordinate: str, push: int) -> SceneEvent:
    """The event that ends the contact with a stop, when its load changes sign; `push` is the sign of the load."""
    return SceneEvent(
        name=leaving(event), watch=load_of(event), level=0.0, crossing="falling" if push > 0 else "rising",
        actions=(Release(coordinate=coordinate),),
    )  # fmt: skip
