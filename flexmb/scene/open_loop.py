"""A scene without its feedback: the open loop of the controlled system."""

from __future__ import annotations

from typing import Any

import msgspec

from flexmb.scene.functions import Constant, ControlSignal
from flexmb.scene.keys import struct_keys
from flexmb.scene.schema import Change, Scene, SceneEvent
from flexmb.scene.tree import watchable
from flexmb.scene.values import PathError, with_values


def open_loop(scene: Scene) -> Scene:
    """The scene without sensors and controllers, and with the value 0 in place of every signal of a controller.

    Events that watch signals or change controllers are removed, too.
    """
    left = msgspec.structs.replace(scene, sensors=(), controllers=())
    if scene.events:
        known = watchable(left)
        events = tuple(event for event in scene.events if event.watch in known and _can_happen(left, event))
        left = msgspec.structs.replace(left, events=events)
    return _silent(left)


def _can_happen(scene: Scene, event: SceneEvent) -> bool:
    """Whether everything that an event changes exists in the scene."""
    try:
        with_values(scene, {action.path: action.value for action in event.actions if isinstance(action, Change)})
    except PathError:
        return False
    return True


def _silent(item: Any) -> Any:
    """A struct, or a tuple of structs, with zero in place of all signals inside; the same object if there is none."""
    if isinstance(item, ControlSignal):
        return Constant(value=0.0)
    if isinstance(item, tuple):
        return tuple(map(_silent, item)) if item and isinstance(item[0], msgspec.Struct) else item
    if not isinstance(item, msgspec.Struct):
        return item
    changes = {key: _silent(getattr(item, key)) for key in struct_keys(type(item))}
    return msgspec.structs.replace(item, **{key: new for key, new in changes.items() if new is not getattr(item, key)})


def refuse_feedback(scene: Scene, what: str, instead: str = "run the scene by simulate") -> None:
    """NotImplementedError for a scene with controllers, which `what` does not support; the message has the remedy."""
    if scene.controllers:
        raise NotImplementedError(
            f'scene "{scene.name}" has controllers, which {what} does not support: give it flexmb.open_loop(scene), or '
            f"{instead}"
        )
