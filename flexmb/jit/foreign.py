"""Functions that are not this package's own, compiled to be called by address from its kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

from flexmb.jit.hooks import SEMANTICS
from flexmb.jit.pointer import pointer


class Uncompilable(TypeError):
    """A function that numba does not take, with its reasons."""


def foreign(function: Callable[..., Any]) -> Any:
    """Mark a function to be compiled, in each process anew: what it reaches may change without our knowing."""
    return njit(**SEMANTICS)(function)


def as_python(function: Any) -> Any:
    """What was written, of a function that is marked to be compiled; any other one itself."""
    return function.py_func if isinstance(function, Dispatcher) else function


def is_foreign(function: Any) -> bool:
    """Whether it is marked to be compiled."""
    return isinstance(function, Dispatcher)


def address_of(function: Any, returned: Any, *arguments: Any) -> int:
    """Of a marked function, compiled for these types; Uncompilable where it cannot be."""
    try:
        return pointer(function, returned, *arguments).__wrapper_address__()
    except (NumbaError, TypeError) as error:
        raise Uncompilable(str(error)) from error
