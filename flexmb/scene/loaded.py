"""The files from which scenes were read, for messages: several scenes may have the same title.

The file is not part of a scene: scenes are compared by their values, and a changed scene has no file.
"""

from __future__ import annotations

from collections.abc import Callable
from weakref import ref

from flexmb.scene.schema import Scene

_files: dict[int, tuple[ref[Scene], str]] = {}  # by identity, because hashing a scene reads all of it


def remember(scene: Scene, file: str) -> None:
    """Record the file of a scene for `called`, for the lifetime of the scene."""
    number = id(scene)
    _files[number] = (ref(scene, _forget(number)), file)


def called(scene: Scene) -> str:
    """The file from which the scene was read, or else its title."""
    known = _files.get(id(scene))
    return known[1] if known is not None and known[0]() is scene else scene.name


def _forget(number: int) -> Callable[[ref[Scene]], None]:
    def forget(gone: ref[Scene]) -> None:
        if number in _files and _files[number][0] is gone:  # not if a new scene has the same identity
            del _files[number]

    return forget
