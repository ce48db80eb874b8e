"""Mutations of events: of their levels and directions, and of their actions."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from msgspec.structs import replace

from crosscheck.library.mutations.edits import of_event
from crosscheck.library.mutations.mutation import FACTOR, HUNDREDTH, LESS, Mutation, MutationTarget, SceneChange
from crosscheck.library.time_functions import scaled
from flexmb.scene.events import Action, Change, Impact, Latch, SceneEvent
from flexmb.scene.functions import Function
from flexmb.scene.schema import Scene
from flexmb.scene.tree import coordinates, watchable

OTHER_WAY = {"rising": "falling", "falling": "rising"}


def events(scene: Scene) -> Iterator[MutationTarget]:
    """All events; one kind for each list of actions."""
    for event in scene.events:
        yield MutationTarget(event.name, "event: " + ", ".join(str(act.__struct_config__.tag) for act in event.actions))


def _of_actions(change: Callable[[Action], Action]) -> SceneChange:
    def changed(event: SceneEvent) -> SceneEvent:
        return replace(event, actions=tuple(map(change, event.actions)))

    return of_event(changed)


def _begins(scene: Scene, event: SceneEvent) -> float:
    """The initial value of the event's quantity (m, rad, or a rate of these; s)."""
    name = watchable(scene)[event.watch]
    for wheel in scene.wheels:
        if name.removesuffix(".angle").removesuffix(".speed") == wheel.name:
            return wheel.angle_rad if name.endswith(".angle") else wheel.speed_rad_s
    for item in (*scene.hinges, *scene.point_masses):
        for key, coordinate in coordinates(item):
            if name.removesuffix(".rate") == f"{item.name}.{key}":
                stem = coordinate.KEYS.rate if name.endswith(".rate") else coordinate.KEYS.value
                return float(getattr(coordinate, stem))
    return 0.0  # of time


def _level(scene: Scene, target: str) -> Scene:
    def farther(event: SceneEvent) -> SceneEvent:
        way = event.level - _begins(scene, event)
        return replace(event, level=event.level + HUNDREDTH * way)

    return of_event(farther)(scene, target)


def _crossing(scene: Scene, target: str) -> Scene:
    """The opposite direction; for an event of both directions the one opposite to its first crossing."""

    def changed(event: SceneEvent) -> SceneEvent:
        against = "falling" if _begins(scene, event) < event.level else "rising"
        return replace(event, crossing=OTHER_WAY.get(event.crossing, against))

    return of_event(changed)(scene, target)


def _dropped(scene: Scene, target: str) -> Scene:
    return replace(scene, events=tuple(event for event in scene.events if event.name != target))


def _not_held(action: Action) -> Action:
    return Impact(coordinate=action.coordinate, restitution=0.0) if isinstance(action, Latch) else action


def _softer(action: Action) -> Action:
    if isinstance(action, Impact):
        return replace(action, restitution=LESS * action.restitution)
    return action


def _larger(action: Action) -> Action:
    if not isinstance(action, Change):
        return action
    value = action.value
    larger = scaled(value, FACTOR) if isinstance(value, Function) else FACTOR * value
    return replace(action, value=larger)


@of_event
def _backwards(event: SceneEvent) -> SceneEvent:
    return replace(event, actions=event.actions[::-1])


MUTATIONS = (
    Mutation(
        "event_level",
        "a level farther by a hundredth of the way there",
        "a wrong figure, or an event found at the end of a step",
        events,
        _level,
    ),
    Mutation(
        "event_crossing",
        "rising for falling, or the other way; neither way for either",
        "a sign",
        events,
        _crossing,
    ),
    Mutation("event_dropped", "no event", "a latch or contact left out", events, _dropped),
    Mutation(
        "event_hold",
        "a latch that takes the speed away and does not hold",
        "an impulse without the constraint after it",
        events,
        _of_actions(_not_held),
    ),
    Mutation("event_restitution", "-1 % restitution", "a wrong figure", events, _of_actions(_softer)),
    Mutation("event_value", "+1 % of what a value changes to", "a wrong figure", events, _of_actions(_larger)),
    Mutation(
        "event_order", "actions in the opposite order", "another order of what happens at once", events, _backwards
    ),
)
