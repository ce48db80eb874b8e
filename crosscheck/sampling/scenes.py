"""A scene with other numbers at paths such as "bodies.rod.mass_kg"."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import msgspec

from crosscheck.library.case import CaseError
from crosscheck.sampling.file import SweepFile
from flexmb.scene.problems import closest
from flexmb.scene.schema import Scene

EVERY = "*"


def with_values(scene: Scene, sweep: SweepFile, values: Iterable[float]) -> Scene:
    """The scene with the value of each parameter; CaseError names a path that leads to no number, and the remedy."""
    for parameter, value in zip(sweep.parameters, values, strict=True):
        for path in parameter.paths:

            def changed(number: float, value: float = value, relative: bool = parameter.relative) -> float:
                return number * value if relative else value

            scene = _changed(scene, path.split("."), path, changed)
    return scene


def _changed(node: Any, steps: list[str], path: str, change: Callable[[float], float]) -> Any:
    """A part of a scene, with the numbers changed that `steps` lead to."""
    if not steps:
        return _number(node, path, change)
    step, rest = steps[0], steps[1:]
    if isinstance(node, msgspec.Struct):
        if step not in node.__struct_fields__:
            raise _no_way(path, step, node.__struct_fields__)
        return msgspec.structs.replace(node, **{step: _changed(getattr(node, step), rest, path, change)})
    if isinstance(node, tuple):
        chosen = {index for index, item in enumerate(node) if step in (EVERY, str(index), getattr(item, "name", None))}
        if not chosen:
            raise _no_way(path, step, [getattr(item, "name", str(index)) for index, item in enumerate(node)])
        return tuple(_changed(item, rest, path, change) if i in chosen else item for i, item in enumerate(node))
    raise CaseError(f'parameter "{path}": nothing lies below {step}, as {node!r} has no parts: end the path before it')


def _number(node: Any, path: str, change: Callable[[float], float]) -> float:
    if isinstance(node, bool) or not isinstance(node, int | float):
        remedy = "write it into the scene first" if node is None else "lead the path to a number"
        raise CaseError(f'parameter "{path}" is no number but {type(node).__name__}: {remedy}')
    value = float(change(node))
    if isinstance(node, float):
        return value
    if not value.is_integer():
        raise CaseError(f'parameter "{path}" counts something: {value:g} is no whole number')
    return int(value)


def _no_way(path: str, step: str, known: Iterable[str]) -> CaseError:
    return CaseError(f'parameter "{path}": there is no "{step}": {closest(step, known)}')
