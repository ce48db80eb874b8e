"""A property that is computed at its first access and kept in its object, without a lock.

`functools.cached_property` holds a lock of the property before Python 3.12 while it computes, for all objects of the
class at once. A process that forks while another thread computes inherits that lock, taken for ever: the first access
in the child waits without end.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar, overload

Value = TypeVar("Value")


class kept(Generic[Value]):  # noqa: N801  (used as `property` is)
    """If two threads compute a value at once, both get the one that is kept first."""

    def __init__(self, find: Callable[[Any], Value]) -> None:
        self._find = find
        self.__doc__ = find.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type | None = None) -> kept[Value]: ...
    @overload
    def __get__(self, instance: object, owner: type | None = None) -> Value: ...
    def __get__(self, instance: Any, owner: type | None = None) -> Value | kept[Value]:
        """The value; later accesses find it in the object itself, because this class defines no `__set__`."""
        if instance is None:
            return self
        values: dict[str, Value] = instance.__dict__
        return values[self._name] if self._name in values else values.setdefault(self._name, self._find(instance))
