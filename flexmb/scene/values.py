"""Scenes with other values at paths such as "rod.mass_kg" or "bodies.rod.nodes.tip.position_m"."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from numbers import Real
from typing import Any, cast

import msgspec

from flexmb.scene.bodies import BeamStation
from flexmb.scene.convert import to_struct
from flexmb.scene.functions import Function
from flexmb.scene.problems import SceneError, closest
from flexmb.scene.reading import Unreadable, parse_toml

EVERY = "*"
SYMMETRIC = ("stiffness", "inertia")
"""Matrices of a beam's station, of which an element off the diagonal stands for both."""


class PathError(ValueError):
    """A path that does not exist in a scene, or a value that cannot be used there; the message names the step."""


def with_values(scene: Any, values: Mapping[str, Any]) -> Any:
    """The scene with other values. Steps of a path are keys; items of an array are chosen by name, number or `*` (all).

    The array of an item may be omitted if only one item has the name. Numbers are replaced by numbers (counts by whole
    ones), arrays by arrays of the same length, structures (such as functions of time) and None by structures of the
    schema or None. An element off the diagonal of a station's matrix stands for both: the matrix stays symmetric.
    Raises PathError if a path or a value does not fit. The scene is checked when it is run.
    """
    for path, value in values.items():
        scene = changed_at(scene, path, partial(_replaced, new=value, path=path))
    return scene


def changed_at(scene: Any, path: str, change: Callable[[Any], Any]) -> Any:
    """The scene with `change` applied at a path, for a path with `*` at all its places; PathError."""
    return _changed(scene, _in_full(scene, path), path, change)


def values_at(scene: Any, path: str) -> list[Any]:
    """What a scene has at a path, for a path with `*` at all its places; PathError where it has nothing."""
    values: list[Any] = []

    def read(value: Any) -> Any:
        values.append(value)
        return value

    changed_at(scene, path, read)
    return values


def number_at(path: str, old: Any, new: float) -> float:
    """The number `new` with the type of `old`; PathError if `old` is not a number, or `new` not whole for a count."""
    if isinstance(old, bool) or not isinstance(old, int | float):
        remedy = "write it into the scene first" if old is None else "give the path of a number"
        raise PathError(f'parameter "{path}" is not a number but {type(old).__name__}: {remedy}')
    if isinstance(old, float):
        return float(new)
    if not float(new).is_integer():
        raise PathError(f'parameter "{path}" is a count: {new:g} is not a whole number')
    return int(new)


def _in_full(scene: Any, path: str) -> list[str]:
    """The steps of a path, beginning with the array of its first item."""
    steps = path.split(".")
    if steps[0] in scene.__struct_fields__:
        return steps
    arrays = {key: [getattr(item, "name", "") for item in getattr(scene, key)] for key in scene.__struct_fields__
              if isinstance(getattr(scene, key), tuple)}  # fmt: skip
    keys = [key for key, names in arrays.items() if steps[0] in names]
    if len(keys) == 1:
        return [keys[0], *steps]
    if keys:
        raise PathError(f'parameter "{path}": {" and ".join(keys)} have a "{steps[0]}": begin with one of them')
    known = [*scene.__struct_fields__, *(name for names in arrays.values() for name in names)]
    raise _no_way(path, steps[0], filter(None, known))


def _changed(node: Any, steps: list[str], path: str, change: Callable[[Any], Any]) -> Any:
    """A part of a scene, changed at the end of `steps`."""
    if not steps:
        return change(node)
    step, rest = steps[0], steps[1:]
    if isinstance(node, msgspec.Struct):
        if step not in node.__struct_fields__:
            raise _no_way(path, step, node.__struct_fields__)
        changed = _changed(getattr(node, step), rest, path, change)
        if isinstance(node, BeamStation) and step in SYMMETRIC and len(rest) == 2 and rest[0] != rest[1]:
            changed = _changed(changed, rest[::-1], path, change)
        return msgspec.structs.replace(node, **{step: changed})
    if isinstance(node, tuple):
        chosen = {index for index, item in enumerate(node) if step in (EVERY, str(index), getattr(item, "name", None))}
        if not chosen:
            raise _no_way(path, step, [getattr(item, "name", str(index)) for index, item in enumerate(node)])
        return tuple(_changed(item, rest, path, change) if i in chosen else item for i, item in enumerate(node))
    raise PathError(f'parameter "{path}": {node!r} has no parts, so there is no "{step}": end the path before it')


def _replaced(old: Any, new: Any, path: str) -> Any:
    """The replacement `new` of `old`, checked to be of the same kind."""
    if old is None or isinstance(old, msgspec.Struct):
        return _structure(old, new, path)
    if isinstance(old, tuple):
        return _array(old, new, path)
    if isinstance(old, str):
        if not isinstance(new, str):
            raise PathError(f'parameter "{path}" is a string: give one, not {new!r}')
        return new
    if isinstance(old, bool):
        raise PathError(f'parameter "{path}" is true or false: write it into the scene; in a run events change it')
    if isinstance(new, bool) or not isinstance(new, Real):
        raise PathError(f'parameter "{path}" is a number: give one, not {new!r}')
    return number_at(path, old, float(new))


def _structure(old: Any, new: Any, path: str) -> Any:
    """A structure of the schema, or a function of time in the form of a file (a dict)."""
    if new is None or isinstance(new, msgspec.Struct):
        return new
    if isinstance(new, dict) and (old is None or isinstance(old, Function)):
        try:
            return to_struct(new, cast(type, Function))
        except SceneError as error:
            raise PathError(f'parameter "{path}": {"; ".join(map(str, error.problems))}') from None
    what = "nothing" if old is None else "a structure"
    raise PathError(f'parameter "{path}" is {what}: give a structure of the schema or None, or a longer path')


def _array(old: tuple[Any, ...], new: Any, path: str) -> tuple[Any, ...]:
    if isinstance(new, str) or not isinstance(new, Sequence) and not hasattr(new, "tolist"):
        raise PathError(f'parameter "{path}" is an array: give one, not {new!r}')
    given = list(new)
    if len(given) != len(old):
        raise PathError(f'parameter "{path}" has {len(old)} entries, not {len(given)}: give as many')
    return tuple(_replaced(a, b, path) for a, b in zip(old, given, strict=True))


def _no_way(path: str, step: str, known: Iterable[str]) -> PathError:
    return PathError(f'parameter "{path}": there is no "{step}": {closest(step, known)}')


def parsed(assignment: str) -> tuple[str, Any]:
    """Path and value of an argument of a command line, `rod.mass_kg=2.0`, whose value is in TOML; PathError."""
    path, equals, text = assignment.partition("=")
    if not equals:
        raise PathError(f'"{assignment}" is not an assignment: write name=value, such as rod.mass_kg=2.0')
    try:
        return path.strip(), parse_toml(f"value = {text}")["value"]
    except Unreadable as problem:
        raise PathError(f'"{assignment}": the value is not valid TOML: {problem}') from None
