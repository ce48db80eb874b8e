"""Properties that each thread has for itself in an object that threads share: workspaces, and calls that use them.

Kernels release the interpreter's lock while they write to a workspace, and one public call often runs several kernels.
A lock around each call would make threads wait for each other; a workspace for each thread does not. It is created
when a thread first needs it, and released with the thread or the object.

Values that are computed once and then only read need no copy for each thread: if two threads compute one at once,
either result is right. Nothing here takes a lock, so that a forked process never inherits a lock that is held.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import local
from typing import Any, Generic, TypeVar, overload

Value = TypeVar("Value")


class Own(local):
    """The values of each thread; a copy, in this process or another, is empty."""

    def __reduce__(self) -> tuple[Any, ...]:
        """An empty object: threads, and the addresses in their values, belong to one process."""
        return Own, ()


class per_thread(Generic[Value]):  # noqa: N801  (used as `property` is)
    """A property that is computed once for each thread, at its first access.

    The values are in the object's attribute `own`. A value set on the object itself is shared by all threads.
    """

    def __init__(self, find: Callable[[Any], Value]) -> None:
        self._find = find
        self.__doc__ = find.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type | None = None) -> per_thread[Value]: ...
    @overload
    def __get__(self, instance: object, owner: type | None = None) -> Value: ...
    def __get__(self, instance: Any, owner: type | None = None) -> Value | per_thread[Value]:
        if instance is None:
            return self
        try:
            return getattr(instance.own, self._name)  # type: ignore[no-any-return]
        except AttributeError:
            pass
        own: Own = instance.__dict__.setdefault("own", Own())  # atomic: two threads at once get the same object
        value = self._find(instance)
        setattr(own, self._name, value)
        return value
