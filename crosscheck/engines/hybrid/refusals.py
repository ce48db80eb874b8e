"""Which events, controllers and sensors the loop of the peers does not take, each with its reason."""

from __future__ import annotations

from collections.abc import Iterator
from typing import assert_never

from crosscheck.engines.hybrid.laws import WRITTEN
from crosscheck.engines.hybrid.reading import TIME, coordinate_names, rate_names, split
from flexmb.scene.functions import ControlSignal
from flexmb.scene.schema import (
    Change,
    CoordinateSensor,
    DistanceSensor,
    Dock,
    DriveSensor,
    EndRun,
    Impact,
    Latch,
    LoadSensor,
    MarkerSensor,
    Release,
    Scene,
    SceneEvent,
    Separate,
    TimeSensor,
    UserLaw,
)

AT_ONCE = ("acceleration", "angular_acceleration", "specific_force")
NO_STOP = "the loop of the peers has stops that reflect only"


def is_hybrid(scene: Scene) -> bool:
    """Whether a run of the scene is more than the solution of a differential equation."""
    return bool(scene.events or scene.controllers)


def refusal(scene: Scene) -> str:
    """Why the loop cannot run the events and controllers of a scene, "" if it can."""
    return next(_refusals(scene), "") if is_hybrid(scene) else ""


def _refusals(scene: Scene) -> Iterator[str]:
    names = coordinate_names(scene)
    items = {item for item, _ in names.values()}
    for sensor in scene.sensors:
        if isinstance(sensor, LoadSensor | DriveSensor) or getattr(sensor, "quantity", "") in AT_ONCE:
            yield f'sensor "{sensor.name}": the loop of the peers reads positions and speeds, no accelerations or loads'
        if isinstance(sensor, CoordinateSensor) and sensor.of not in items | set(names):
            yield f'sensor "{sensor.name}": the loop of the peers reads scalar coordinates, and "{sensor.of}" is none'
    for law in scene.controllers:
        if isinstance(law, UserLaw) and law.function not in WRITTEN:
            yield f'controller "{law.name}": "{law.function}" is not written once more for the loop of the peers'
    for connector in scene.connectors:
        for key in connector.__struct_fields__:
            if isinstance(getattr(connector, key), ControlSignal):
                yield f'connector "{connector.name}": the loop of the peers has signals in motors and loads only'
    for event in scene.events:
        yield from _of_event(scene, event, names)


def _of_event(scene: Scene, event: SceneEvent, names: dict[str, tuple[str, int]]) -> Iterator[str]:
    watched, rates = event.watch, rate_names(scene)
    readable = (CoordinateSensor, MarkerSensor, DistanceSensor, TimeSensor)
    smooth = {sensor.name for sensor in scene.sensors if isinstance(sensor, readable)}
    if watched != TIME and watched not in names and watched not in rates and split(watched)[0] not in smooth:
        yield f'event "{event.name}": the loop of the peers watches time, coordinates and sensors of the motion only'
    for action in event.actions:
        match action:
            case EndRun():
                yield f'event "{event.name}" ends the run, and engines are asked for all samples'
            case Impact(rests=True):
                yield f'event "{event.name}": {NO_STOP}, and this one holds what rests on it'
            case Latch() | Impact() | Release():
                yield from _of_coordinate(scene, event, action.coordinate, names)
            case Change(path=path):
                if path.split(".")[-1] in ("period_s", "offset_s", "delay_s"):
                    yield f'event "{event.name}": the loop of the peers keeps the instants of controllers'
            case Separate() | Dock():
                yield f'event "{event.name}": closures in the loop of the peers are closed at all times'
            case _:
                assert_never(action)


def _of_coordinate(scene: Scene, event: SceneEvent, name: str, names: dict[str, tuple[str, int]]) -> Iterator[str]:
    if scene.constraints:
        yield f'event "{event.name}": impulses in the loop of the peers are those of trees, not of closures'
    item, _ = names[name]
    if sum(each == item for each, _ in names.values()) > 1:
        yield f'event "{event.name}": the loop of the peers holds hinges of one coordinate, and "{item}" has more'
