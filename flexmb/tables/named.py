"""Parts of a result by their names in the scene; a name that is not there is refused with those that are."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar, NoReturn, TypeVar

from flexmb.scene.problems import closest

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
