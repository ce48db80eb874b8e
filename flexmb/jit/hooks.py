"""The use of numba's internals: three hooks, for the versions of numba with which they were tested.

`parts`  helpers are compiled into their callers only; see `flexmb/jit/parts.py`.
`keep`   compiled kernels are kept on disk by our own cache; see `flexmb/jit/cache.py`.
`address`  a compiled kernel is called by the address of the wrapper that numba made with it; see `pointer.py`.

A kernel that kernels call with constants, as in `velocity_sweep(c, w, False, True)`, is compiled once for all values:
numba by itself compiles a version for each.

With any other numba, or if one of the internals is missing, kernels are compiled by plain `njit` and called through
`cfunc`, both documented: results are the same, every process compiles anew, and one warning says so. Numba's own cache
cannot be used instead: it does not notice an edited helper in another file, and two processes may overwrite each
other's entries.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from types import FunctionType
from typing import Any

from numba import __version__, cfunc
from numba.types import unliteral

from flexmb.jit.folder import cache_directory, warn_once
from flexmb.jit.progress import announced

OLDEST, NEWEST = (0, 60), (0, 68)  # numba versions with which the hooks were tested: tests/flexmb/jit/test_hooks.py

# "contract" fuses a*b + c. Not "nnan" or "ninf", which would let the compiler delete the checks for finite numbers.
SEMANTICS: dict[str, Any] = {"fastmath": {"contract"}, "error_model": "numpy", "nogil": True}


def _compiled_anew(compiled: Any, function: FunctionType) -> None:
    """Announce long compilations; nothing is kept."""
    compiled.compile = _announcing(compiled.compile, function)


def _announcing(compile: Callable[[Any], Any], function: FunctionType) -> Callable[[Any], Any]:
    """The `compile` of a kernel that is not kept, with a message if it takes long."""

    def compile_anew(signature: Any) -> Any:
        with announced(function, None):
            return compile(signature)

    return compile_anew


def _through_cfunc(kernel: Any, signature: Any) -> int:
    return int(_c_function(kernel, signature).address)


@cache
def _c_function(kernel: Any, signature: Any) -> Any:
    """Kept as long as the process, because its address is valid only while it exists."""
    return cfunc(signature, **SEMANTICS)(kernel.py_func)


@dataclass(frozen=True)
class Hooks:
    """How helpers and kernels are compiled; the defaults use only documented parts of numba."""

    parts: dict[str, Any] = field(default_factory=dict)  # options of njit for a helper
    kernels: dict[str, Any] = field(default_factory=dict)  # of a kernel
    keep: Callable[[Any, FunctionType], None] = _compiled_anew  # (dispatcher, its function)
    address: Callable[[Any, Any], int] = _through_cfunc  # of (dispatcher, signature), once it is compiled for it


def _by_internals() -> Hooks:
    """Raises ImportError or AttributeError for versions of numba that were not tested."""
    if not OLDEST <= _version() <= NEWEST:
        raise ImportError(f"it was tried with {_text(OLDEST)} to {_text(NEWEST)}")
    from numba.core.types.function_type import CompileResultWAP

    from flexmb.jit.cache import KernelCache
    from flexmb.jit.parts import KernelCompiler, PartCompiler

    def keep(compiled: Any, function: FunctionType) -> None:
        compiled._cache = cache = KernelCache(function, cache_directory())
        compiled.compile = cache.filling(compiled)
        compiled.get_call_template = _of_any_value(compiled.get_call_template)

    def address(kernel: Any, signature: Any) -> int:
        return int(CompileResultWAP(kernel.overloads[signature.args]).__wrapper_address__())

    parts = {
        "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "forceinline": True, "pipeline_class": PartCompiler
    }  # fmt: skip
    return Hooks(parts, {"pipeline_class": KernelCompiler}, keep, address)


def _of_any_value(resolve: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """How numba finds the version of a kernel for a call from another kernel, by the types of constants alone."""

    def typed(arguments: Any, named: Any) -> Any:
        return resolve([unliteral(each) for each in arguments], {name: unliteral(each) for name, each in named.items()})

    return typed


def _version() -> tuple[int, int]:
    major, minor = __version__.split(".")[:2]
    return int(major), int(minor)


def _text(version: tuple[int, int]) -> str:
    return ".".join(map(str, version))


def _hooks() -> Hooks:
    try:
        return _by_internals()
    except (ImportError, AttributeError, ValueError) as problem:  # ValueError: a build without a number
        warn_once(
            f"numba {__version__} is not one that flexmb knows from inside ({problem}): compilation takes longer and "
            f"every process does it anew; results are the same. Install numba>={_text(OLDEST)},<={_text(NEWEST)}.*"
        )
        return Hooks()


HOOKS = _hooks()
