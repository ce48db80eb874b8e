"""Which file a scene was read from, for messages: of several scenes with one title, only the file tells which.

It is no part of the scene: scenes are equal by what they say, and one with other values was read from nowhere.
"""

from __future__ import annotations

from collections.abc import Callable
from weakref import ref

from flexmb.scene.schema import Scene

_files: dict[int, tuple[ref[Scene], str]] = {}  # by identity: to hash a scene is to read all of it


def remember(scene: Scene, file: str) -> None:
    """`called` names the file from now on, as long as the scene lives."""
    number = id(scene)
    _files[number] = (ref(scene, _forget(number)), file)


def called(scene: Scene) -> str:
    """The file that the scene was read from, or its title."""
    known = _files.get(id(scene))
    return known[1] if known is not None and known[0]() is scene else scene.name


def _forget(number: int) -> Callable[[ref[Scene]], None]:
    def forget(gone: ref[Scene]) -> None:
        if number in _files and _files[number][0] is gone:  # else another scene has taken its place
            del _files[number]

    return forget
