"""What every thread has of its own in an object that threads share: workspaces, and calls that write into them.

Kernels let go of the interpreter's lock while they write into a workspace, and a question often takes several kernels,
one after the other. A lock around each question would make threads wait for each other; a workspace for each thread
makes nobody wait. It is made when a thread first needs it, and let go when the thread ends, or the object.

What is built once and only read needs no thread's own: of two that build it at once, either is right. So nothing here
takes a lock, and a process that is forked off in the middle of anything finds none that is held.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import local
from typing import Any, Generic, TypeVar, overload

Value = TypeVar("Value")


class Own(local):
    """What each thread keeps; a copy, in this process or another, begins with nothing."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Addresses are of one process, and threads too."""
        return Own, ()


class per_thread(Generic[Value]):  # noqa: N801  (used as `functools.cached_property` is)
    """A property that each thread finds once, when it first asks, and keeps.

    The object keeps them in its attribute `own`. A value that is set on the object itself is there for all threads.
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
        own: Own = instance.__dict__.setdefault("own", Own())  # of two threads at once, both get the one that is kept
        found = self._find(instance)
        setattr(own, self._name, found)
        return found
