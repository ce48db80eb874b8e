"""A scene without its feedback: what is controlled, by itself."""

from __future__ import annotations

from typing import Any

import msgspec

from flexmb.scene.columns import struct_keys
from flexmb.scene.functions import Constant, ControlSignal
from flexmb.scene.schema import Scene


def open_loop(scene: Scene) -> Scene:
    """The scene without sensors and controllers; what they drove stays where it was, with value 0."""
    return _silent(msgspec.structs.replace(scene, sensors=(), controllers=()))


def _silent(item: Any) -> Any:
    """A struct, or a tuple of some, with every signal inside it zero; the same one where there is none."""
    if isinstance(item, ControlSignal):
        return Constant(value=0.0)
    if isinstance(item, tuple):
        return tuple(map(_silent, item)) if item and isinstance(item[0], msgspec.Struct) else item
    if not isinstance(item, msgspec.Struct):
        return item
    changes = {key: _silent(getattr(item, key)) for key in struct_keys(type(item))}
    return msgspec.structs.replace(item, **{key: new for key, new in changes.items() if new is not getattr(item, key)})


def refuse_feedback(scene: Scene, what: str) -> None:
    """NotImplementedError for a scene with controllers, which `what` would ignore."""
    if scene.controllers:
        raise NotImplementedError(
            f'scene "{scene.name}" has controllers, and {what} knows of none: give it flexmb.open_loop(scene), or run '
            "the scene by simulate"
        )
