"""Scenes as TOML files; a scene that is written and read again is equal, bit for bit.

Keys with their default value are omitted. A body that refers to a file (`.npz`, SID) has a path relative to the scene's
folder in TOML, and an absolute path in a loaded `Scene`. Thus a folder can be moved as a whole, and a Scene can be used
from any folder.

The reader is Python's. The writer is part of flexmb because the usual library writes each component of a vector on a
line of its own, which people cannot read; tests check the two against each other on random scenes.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import msgspec

from flexmb.output.files import write_whole
from flexmb.scene.bodies import ModalBody, SidBody
from flexmb.scene.convert import plain, to_struct
from flexmb.scene.loaded import remember
from flexmb.scene.pieces import ByThemselves
from flexmb.scene.problems import Defect, SceneError
from flexmb.scene.reading import Unreadable, parse_toml, read_text
from flexmb.scene.schema import Scene

LINE = 110  # characters: longer arrays are written with one item per line


def load_scene(path: str | os.PathLike[str]) -> Scene:
    """Read a scene file; file references become absolute. Raises SceneError with place and remedy, or OSError.

    Types, keys and lengths are checked here; `check_scene` checks the physics.
    """
    path = Path(path)
    try:
        text = read_text(path)
    except Unreadable as error:
        raise _unreadable(str(path), error) from None
    scene = loads(text, path.parent, name=str(path))
    remember(scene, str(path))
    return scene


def save_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene file; file references become relative to its folder, which must exist."""
    path = Path(path)
    write_whole(path, dumps(scene, path.parent))


def loads(text: str, folder: str | os.PathLike[str] | None = None, *, name: str = "<text>") -> Scene:
    """A scene from TOML text; file references become absolute, relative to `folder`. `name` is used in errors."""
    try:
        data = parse_toml(text)
    except Unreadable as error:
        raise _unreadable(name, error) from None
    scene = to_struct(data, Scene, name)
    return scene if folder is None else _with_files(scene, lambda file: os.path.abspath(os.path.join(folder, file)))


def dumps(scene: Scene, folder: str | os.PathLike[str] | None = None) -> str:
    """A scene as TOML text; file references become relative to `folder`, if given."""
    if folder is not None:
        scene = _with_files(scene, lambda file: _relative(file, folder))
    table = _sparse(scene)
    simple = [f"{key} = {_value(value, len(key) + 3)}" for key, value in table.items() if not _is_tables(value)]
    tables = [
        "\n".join([f"\n[[{key}]]", *(f"{k} = {_value(v, len(k) + 3)}" for k, v in item.items())])
        for key, items in table.items()
        if _is_tables(items)
        for item in items
    ]
    return "\n".join([*simple, *tables]) + "\n"


def inline(value: Any) -> str:
    """One value (struct, array, number, string) as TOML on one line, without keys that have their default value."""
    return _value(_sparse(value), 0)


def _unreadable(name: str, error: Unreadable) -> SceneError:
    return SceneError(name, [Defect(name, error.what, error.remedy)])


def _relative(file: str, folder: str | os.PathLike[str]) -> str:
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive on Windows: no relative path exists
        return os.path.abspath(file)


def _with_files(scene: Scene, change: Any) -> Scene:
    bodies = tuple(
        msgspec.structs.replace(body, file=change(body.file))
        if isinstance(body, ModalBody | SidBody) and body.file is not None
        else body
        for body in scene.bodies
    )
    return msgspec.structs.replace(scene, bodies=bodies)


def _sparse(value: Any) -> Any:
    """A struct as a dict of its tag and all values that differ from the default; likewise sequences of structs."""
    if isinstance(value, msgspec.Struct):
        config = value.__struct_config__
        table: dict[str, Any] = {str(config.tag_field): config.tag} if config.tag is not None else {}
        for field in msgspec.structs.fields(value):
            item = getattr(value, field.name)
            if field.required or not (item == field.default or isinstance(item, ByThemselves)):  # read, they come again
                table[field.encode_name] = _sparse(item)
        return table
    if isinstance(value, list | tuple):
        return [_sparse(item) for item in value]
    return plain(value)


def _is_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], dict)


def _value(value: Any, used: int, indent: str = "") -> str:
    """One TOML value, inline, for a line that already has `used` characters."""
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return repr(value)
        case str():
            return _string(value)
        case dict() if not value:
            return "{}"
        case dict():
            return "{ " + ", ".join(f"{key} = {_value(item, 0)}" for key, item in value.items()) + " }"
        case list():
            # An inline table may not contain line breaks: only arrays outside of one, where used > 0, are broken up.
            flat = "[" + ", ".join(_value(item, 0) for item in value) + "]"
            if used == 0 or used + len(flat) <= LINE or not any(isinstance(item, list | dict) for item in value):
                return flat
            deeper = indent + "  "
            lines = [deeper + _value(item, len(deeper) if isinstance(item, list) else 0, deeper) for item in value]
            return "[\n" + ",\n".join(lines) + ",\n" + indent + "]"
    raise TypeError(f"TOML cannot represent a {type(value).__name__}")


def _string(text: str) -> str:
    """A TOML string; its escapes are those of JSON, and that of DEL. Line breaks are kept in a multi-line string."""
    lines = [json.dumps(line, ensure_ascii=False)[1:-1].replace("\x7f", "\\u007f") for line in text.split("\n")]
    return f'"{lines[0]}"' if len(lines) == 1 else '"""\n' + "\n".join(lines) + '"""'
