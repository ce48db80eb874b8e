"""Functions of users, compiled to be called by address from kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

from flexmb.jit.hooks import SEMANTICS
from flexmb.jit.pointer import pointer


class Uncompilable(TypeError):
    """A function that numba cannot compile, with its reasons."""


def foreign(function: Callable[..., Any]) -> Any:
    """Mark a function to be compiled, anew in each process, because changes of the code it calls cannot be detected."""
    return njit(**SEMANTICS)(function)


def as_python(function: Any) -> Any:
    """The Python function behind a marked function; any other function is returned unchanged."""
    return function.py_func if isinstance(function, Dispatcher) else function


def is_foreign(function: Any) -> bool:
    """Whether a function is marked to be compiled."""
    return isinstance(function, Dispatcher)


def address_of(function: Any, returned: Any, *arguments: Any) -> int:
    """Address of a marked function, compiled for these types; Uncompilable if that is impossible."""
    try:
        return pointer(function, returned, *arguments).__wrapper_address__()
    except (NumbaError, TypeError) as error:
        raise Uncompilable(str(error)) from error
