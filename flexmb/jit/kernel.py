"""Compilation of kernels.

`kernel` marks an entry point: compiled for the argument types of its first call, callable from Python and from other
kernels (see `linking.py`), cached on disk.
`helper` marks a function that is called from kernels only: it is compiled into its callers, has no Python wrapper, no
machine code and no cache entry of its own (see `parts.py`). From Python, call its `.py_func`. `handed_on` marks one
that kernels take as an argument.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from numba import config, njit
from numba.extending import overload

from flexmb.jit.bundle import BundleType, is_long
from flexmb.jit.hooks import HOOKS, SEMANTICS
from flexmb.jit.lanes import LANE

if config.DISABLE_JIT:
    raise ImportError(
        "flexmb runs compiled kernels only, and NUMBA_DISABLE_JIT is set: unset it. To look into a kernel, call its "
        "py_func, or see flexmb.jit.counting, which interprets kernels"
    )

AS_PART: dict[str, Any] = SEMANTICS | HOOKS.parts


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` as an entry point, cached on disk."""
    compiled = njit(**SEMANTICS, **HOOKS.kernels)(function)
    HOOKS.keep(compiled, function)
    return compiled


def helper(function: Callable[..., Any]) -> Any:
    """Compile `function` into the kernels that call it."""
    return njit(**AS_PART)(function)


def sweep(function: Callable[..., Any]) -> Any:
    """A helper that is part of the kernels that call it, but called there, not inlined at every call.

    For loops over all bodies or over matrices, beside which a call costs nothing: kernels that have several are smaller
    and compiled in less time. What most kernels need is better a `kernel` of its own, whose code is there once for all.
    """
    return njit(**(AS_PART | {"forceinline": False}))(function)


def written_out(function: Callable[..., Any]) -> Any:
    """A helper that is written out where it is called.

    For the short ones around a call by address, which no optimiser sees through: arrays that are handed on once more on
    their way there are counted again. It takes longer to compile.
    """
    return njit(inline="always", **AS_PART)(function)


def handed_on(function: Callable[..., Any]) -> Any:
    """A helper that kernels take as an argument, or hold in a tuple, and hand on to others, which call it.

    It is handed on by its type alone, and chosen by that while its caller is compiled, like `by_bundle`. A plain helper
    is a value too, its address in this process: a kernel that hands one on to what is not written out cannot be kept.
    """
    part = sweep(function)

    def choose(*args: Any) -> Any:
        return function(*args)

    @overload(choose, jit_options=AS_PART)
    def _typed(*args):
        def call(*args):
            return part(*args)

        return _named_after(part, call)

    choose.py_func = function  # type: ignore[attr-defined]
    return choose


def handed_in(function: Callable[..., Any]) -> Any:
    """The same of a helper that is written out where it is called: for a part of a loop that calls it at one place.

    Beside short steps a call costs as much as they do: all arrays that are handed on are counted again.
    """

    def choose(*args: Any) -> Any:
        return function(*args)

    @overload(choose, jit_options=AS_PART, strict=False)
    def _typed(*args):
        return function

    choose.py_func = function  # type: ignore[attr-defined]
    return choose


def by_bundle(kind: type, of_kind: Callable[..., Any], others: Callable[..., Any]) -> Callable[..., Any]:
    """One helper for two kinds of bundles: `of_kind` where the first argument is of class `kind`, else `others`.

    Decided by type, while the caller is compiled: a kernel is compiled once for each class of bundles that it is called
    with, and contains nothing of the other.
    """

    def choose(bundle: Any, *args: Any) -> Any:
        return (of_kind if isinstance(bundle, kind) else others)(bundle, *args)

    @overload(choose, jit_options=AS_PART)
    def _typed(bundle, *args):
        is_of_kind = isinstance(bundle, BundleType) and issubclass(bundle.of, kind)
        choice = of_kind if is_of_kind else others

        def call(bundle, *args):
            return choice(bundle, *args)

        return _named_after(choice, call)

    return choose


def by_number(one: Callable[..., Any], lanes: Callable[..., Any]) -> Callable[..., Any]:
    """One function for two kinds of numbers: `lanes` where an argument is a `flexmb.jit.lanes.LaneType`, else `one`.

    Decided by type, while the caller is compiled, like `by_bundle`.
    """

    def choose(*args: Any) -> Any:
        return (lanes if any(each is LANE for each in args) else one)(*args)

    @overload(choose, jit_options=AS_PART)
    def _typed(*args):
        choice = lanes if LANE in args else one

        def call(*args):
            return choice(*args)

        return _named_after(choice, call)

    return choose


def by_width(strips: Callable[..., Any], one: Callable[..., Any]) -> Callable[..., Any]:
    """One function of (c, w, ...): `strips` where strips of the workspace w have several elements, else `one`.

    Decided by type, while the caller is compiled, like `by_bundle`; interpreted as Python it is `one`.
    """

    def choose(c: Any, w: Any, *args: Any) -> Any:
        interpreted, _ = one, strips  # both are named, for what it refers to is what the key of a kernel knows
        return interpreted(c, w, *args)

    @overload(choose, jit_options=AS_PART)
    def _typed(c, w, *args):
        choice = strips if is_long(w) else one

        def call(c, w, *args):
            return choice(c, w, *args)

        return _named_after(choice, call)

    return choose


def _named_after(choice: Callable[..., Any], call: Callable[..., Any]) -> Callable[..., Any]:
    """The call with a symbol of its own: of two equal symbols in two files of the cache, the linker takes the first."""
    called = getattr(choice, "py_func", choice)
    call.__qualname__ = f"call.{called.__module__}.{called.__qualname__}"
    return call
