"""Kernels that call kernels: machine code that is there once, whoever calls, found by a name.

The recursions over a tree are most of what two dozen kernels do. Each is a kernel of its own; another that calls it has
a symbol in its place, named after all that the code behind it depends on, and whoever loads or compiles the caller
puts the address there. So a symbol can never stand for other code than the caller was compiled for, and a process that
finds no such kernel on disk compiles it, as it does one that is called from Python.
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
    """A version of a kernel, as those that call it name it: where it is defined, for which types, by what symbol."""

    module: str
    name: str
    arguments: tuple[Any, ...]
    symbol: str


@dataclass(frozen=True)
class _Code:
    """Machine code of a version of a kernel: the callee that it is, and its address in this process."""

    callee: Callee
    own_symbol: str
    address: int


_codes: WeakKeyDictionary[Any, _Code] = WeakKeyDictionary()  # by numba's library


def offer(compiled: Any, function: FunctionType, key: str) -> None:
    """Let kernels call this one, just compiled or loaded; `key` names all that its code depends on."""
    callee = Callee(function.__module__, function.__qualname__, compiled.signature.args, _SYMBOL.format(key))
    own = compiled.fndesc.llvm_func_name
    _codes[compiled.library] = _Code(callee, own, compiled.library.get_pointer_to_function(own))


def refer(module: Any, library: Any) -> Callee | None:
    """Name in a module of LLVM what it calls of a library by its symbol; None where that is no kernel's.

    TypeError for a kernel that was made in a function: another process could not find it, nor load who calls it.
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
    """Have all of these in this process, for a caller that is to be loaded: their libraries, which it has to hold.

    None where one is not what it was, or not where it was.
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
    """The kernel; None where its module, or a kernel of this name in it, is no more."""
    try:
        found = getattr(import_module(callee.module), callee.name, None)
    except ImportError:
        return None
    return found if hasattr(found, "overloads") else None
