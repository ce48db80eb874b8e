"""Kernels that call kernels: their machine code exists once for all callers, which refer to it by a symbol.

Two dozen kernels consist mostly of the recursions over a tree. Each recursion is a kernel; a kernel that calls it
contains a symbol, whose name depends on everything that the code behind it depends on, and which is bound to the
address when the caller is loaded or compiled. A symbol therefore always refers to the code for which the caller was
compiled, and a process that does not find that kernel on disk compiles it, as for calls from Python.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from types import FunctionType
from typing import Any
from weakref import WeakKeyDictionary

from llvmlite import binding

_SYMBOL = "flexmb.{}"


@dataclass(frozen=True)
class Callee:
    """A version of a kernel as seen by its callers: its module and name, the types of its arguments, and its symbol."""

    module: str
    name: str
    arguments: tuple[Any, ...]
    symbol: str


@dataclass(frozen=True)
class _Code:
    """Machine code of a version of a kernel: its description as a callee, and its address in this process."""

    callee: Callee
    own_symbol: str
    address: int


_codes: WeakKeyDictionary[Any, _Code] = WeakKeyDictionary()  # by numba's library


def offer(compiled: Any, function: FunctionType, key: str) -> None:
    """Make a kernel that was just compiled or loaded available to callers; `key` depends on all its code depends on."""
    callee = Callee(function.__module__, function.__qualname__, compiled.signature.args, _SYMBOL.format(key))
    own = compiled.fndesc.llvm_func_name
    _codes[compiled.library] = _Code(callee, own, compiled.library.get_pointer_to_function(own))


def refer(module: Any, library: Any) -> Callee | None:
    """Rename the function of a library to its symbol in the LLVM module that calls it; None if it is no kernel.

    TypeError for a kernel that was defined in a function, because other processes could not find it.
    """
    code = _codes.get(library)
    if code is None:
        return None
    if "<locals>" in code.callee.name:
        raise TypeError(f"{code.callee.name} is called by a kernel: define it at the top of its module")
    binding.add_symbol(code.callee.symbol, code.address)
    module.get_function(code.own_symbol).name = code.callee.symbol
    return code.callee


def resolve(callees: tuple[Callee, ...]) -> tuple[Any, ...] | None:
    """Load or compile the callees of a kernel that is to be loaded; their libraries, which the caller must keep.

    None if one has changed or is not found.
    """
    libraries = []
    for callee in callees:
        kernel = _find(callee)
        if kernel is None:
            return None
        kernel.compile(callee.arguments)
        library = kernel.overloads[callee.arguments].library
        code = _codes.get(library)
        if code is None or code.callee.symbol != callee.symbol:
            return None
        binding.add_symbol(callee.symbol, code.address)
        libraries.append(library)
    return tuple(libraries)


def _find(callee: Callee) -> Any:
    """The kernel; None if its module, or a kernel of this name in it, does not exist any more."""
    try:
        found = getattr(import_module(callee.module), callee.name, None)
    except ImportError:
        return None
    return found if hasattr(found, "overloads") else None
