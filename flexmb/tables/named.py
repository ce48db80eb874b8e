"""What results show at an interactive prompt, a few lines whatever their size; and their parts by names of the scene: a
name that is not there is refused with those that are.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, ClassVar, NoReturn, TypeVar

import numpy as np

from flexmb.scene.problems import closest

SHOWN = 6  # numbers of an array, or members of a sequence, that are shown themselves
LETTERS = 60  # of a text, or of a member


def brief(result: Any) -> str:
    """The class of a dataclass and its fields; of large arrays the shape, of tables and long sequences the size."""
    fields = [field for field in dataclasses.fields(result) if field.repr]
    shown = [f"{field.name}={_shown(getattr(result, field.name))}" for field in fields]
    return f"{type(result).__name__}({', '.join(shown)})"


def _shown(value: Any) -> str:
    if isinstance(value, np.ndarray):
        if value.size <= SHOWN:
            return str(_rounded(value.tolist()))
        return f"<{value.dtype.name} {' x '.join(map(str, value.shape))}>"
    if isinstance(value, str):
        return repr(value) if len(value) <= LETTERS else f"{value[: LETTERS - 3]!r}..."
    if isinstance(value, Mapping):
        return f"<{len(value)} by name>" if value else "{}"
    if isinstance(value, Sequence):
        members = [_shown(member) for member in value[:SHOWN]]
        if len(value) <= SHOWN and sum(map(len, members)) <= LETTERS:
            return f"({', '.join(members)})"
        return f"<{len(value)} of {type(value[0]).__name__}>"
    text = repr(value)
    return text if len(text) <= 2 * LETTERS and "\n" not in text else f"<{type(value).__name__}>"


def _rounded(numbers: Any) -> Any:
    """Numbers of nested lists with six digits, which a reader takes in."""
    if isinstance(numbers, list):
        return [_rounded(number) for number in numbers]
    return type(numbers)(f"{numbers:.6g}") if isinstance(numbers, float | complex) else numbers


Value = TypeVar("Value")


class PartsByName(dict[str, Value]):
    """A dictionary of which a name that is not there is a KeyError with its place and the remedy.

    Each place has a class of its own, `named`: a dictionary that stores its place would take longer to make than an
    evaluation has time for.
    """

    __slots__ = ()
    _place: ClassVar[str] = ""

    def __missing__(self, name: Any) -> NoReturn:
        asked = f'"{name}"' if isinstance(name, str) else repr(name)
        raise KeyError(f"{self._place}[{asked}]: there is no such name here: {closest(str(name), self)}")

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is made like a new one."""
        return _again, (self._place, dict(self))


@cache
def named(place: str) -> type[PartsByName[Any]]:
    """The dictionaries of a place: what the user has written before the bracket, such as "markers"."""
    return type("PartsByName", (PartsByName,), {"_place": place, "__slots__": (), "__module__": __name__})


def _again(place: str, values: Mapping[str, Any]) -> PartsByName[Any]:
    return named(place)(values)


def parts_of(*fields: str) -> tuple[tuple[str, type[PartsByName[Any]]], ...]:
    """These fields of a result, with the dictionaries that they are to be."""
    return tuple((field, named(field)) for field in fields)


def name_parts(result: Any, parts: tuple[tuple[str, type[PartsByName[Any]]], ...]) -> None:
    """Make these fields of a frozen dataclass dictionaries of these kinds, where they are dictionaries."""
    held = result.__dict__
    for field, kind in parts:
        if type(held[field]) is dict:
            held[field] = kind(held[field])
