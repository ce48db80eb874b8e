"""Parts of a result by their names in the scene; a name that is not there is refused with those that are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn, TypeVar

from flexmb.scene.problems import closest

Value = TypeVar("Value")


class Named(dict[str, Value]):
    """A dictionary of which a name that is not there is a KeyError with its place and the remedy."""

    def __init__(self, place: str, values: Mapping[str, Value]) -> None:
        """`place`: what the user has written before the bracket, such as "markers"."""
        super().__init__(values)
        self._place = place

    def __missing__(self, name: Any) -> NoReturn:
        asked = f'"{name}"' if isinstance(name, str) else repr(name)
        raise KeyError(f"{self._place}[{asked}]: there is no such name here: {closest(str(name), self)}")

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is made like a new one."""
        return type(self), (self._place, dict(self))


def name_parts(result: Any, *fields: str) -> None:
    """Make these fields of a frozen dataclass dictionaries of this kind, where they are dictionaries."""
    for field in fields:
        values = getattr(result, field)
        if type(values) is dict:
            object.__setattr__(result, field, Named(field, values))
