"""Compilation of kernels.

`kernel` marks an entry point: compiled for the argument types of its first call, callable from Python and from other
kernels (see `linking.py`), cached on disk.
`helper` marks a function that is called from kernels only: it is compiled into its callers and has no Python wrapper,
no machine code and no cache entry of its own (see `parts.py`). From Python, call its `.py_func`. `handed_on` marks a
helper that kernels take as an argument.
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
    """A helper that is compiled into the kernels that call it, but as a function, not inlined at every call.

    For loops over all bodies or over matrices, for which the cost of a call is negligible: kernels with several calls
    become smaller and compile faster. Functions that most kernels need should rather be a `kernel`, which is compiled
    once for all of them.
    """
    return njit(**(AS_PART | {"forceinline": False}))(function)


def written_out(function: Callable[..., Any]) -> Any:
    """A helper that numba inlines into its callers before type inference.

    For short helpers around a call by address, which the optimiser cannot look into: every function that passes arrays
    on would count their references again. It takes longer to compile.
    """
    return njit(inline="always", **AS_PART)(function)


def handed_on(function: Callable[..., Any]) -> Any:
    """A helper that kernels take as an argument, or hold in a tuple, and pass on to others, which call it.

    It is identified by its type alone, and selected while its caller is compiled, like `by_bundle`. A plain helper also
    has a value, its address in this process, so that a kernel that passes it to a function that is not inlined cannot
    be kept on disk.
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
    """The same for a helper that is inlined: for a part of a loop that calls it at one place.

    A call costs as much as a short step, because the references of all arrays that are passed are counted again.
    """

    def choose(*args: Any) -> Any:
        return function(*args)

    @overload(choose, jit_options=AS_PART, strict=False)
    def _typed(*args):
        return function

    choose.py_func = function  # type: ignore[attr-defined]
    return choose


def by_bundle(kind: type, of_kind: Callable[..., Any], others: Callable[..., Any]) -> Callable[..., Any]:
    """One helper for two kinds of bundles: `of_kind` if the first argument is of class `kind`, else `others`.

    Decided by type while the caller is compiled: a kernel is compiled separately for each class of bundles, and
    contains only one of the two.
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
    """One function for two kinds of numbers: `lanes` if an argument is a `flexmb.jit.lanes.LaneType`, else `one`.

    Decided by type while the caller is compiled, like `by_bundle`.
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
    """One function of (c, w, ...): `strips` if strips of the workspace w have several elements, else `one`.

    Decided by type while the caller is compiled, like `by_bundle`; interpreted as Python it is `one`.
    """

    def choose(c: Any, w: Any, *args: Any) -> Any:
        interpreted, _ = one, strips  # a reference to both, so that the fingerprint of a kernel contains both
        return interpreted(c, w, *args)

    @overload(choose, jit_options=AS_PART)
    def _typed(c, w, *args):
        choice = strips if is_long(w) else one

        def call(c, w, *args):
            return choice(c, w, *args)

        return _named_after(choice, call)

    return choose


def _named_after(choice: Callable[..., Any], call: Callable[..., Any]) -> Callable[..., Any]:
    """`call` with a unique symbol: if two files of the cache have equal symbols, the linker takes the first."""
    called = getattr(choice, "py_func", choice)
    call.__qualname__ = f"call.{called.__module__}.{called.__qualname__}"
    return call
