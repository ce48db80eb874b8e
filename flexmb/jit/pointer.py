"""Kernels as arguments of kernels, by address: a kernel that takes one is compiled once for all of equal signature.

Bundles are passed as `AnyBundle`, a type that does not depend on their contents. A call through an address costs some
20 ns, which is negligible where the called kernel takes a thousand times as long, as when an integrator evaluates
equations of motion. An integrator, which compiles in some 2 s of processor time, is compiled once instead of once for
each algorithm and kind of scene.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba import types
from numba.experimental import function_type  # noqa: F401  (how numba sees the type of a `Pointer`)
from numba.types import WrapperAddressProtocol

from flexmb.jit.bundle import AnyBundle, BundleType
from flexmb.jit.hooks import HOOKS

REAL, VECTOR, MATRIX, INDEX = types.float64, types.float64[::1], types.float64[:, ::1], types.int64[::1]
STATUS, WHOLE, VOID = types.int64, types.int64, types.none
COMPLEX, COMPLEX_VECTOR = types.complex128, types.complex128[::1]


class Pointer(WrapperAddressProtocol):  # type: ignore[misc]
    """The address of a kernel with the methods that numba requires of an argument of this type."""

    def __init__(self, address: int, signature: Any) -> None:
        self._address, self._signature = address, signature

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Any:
        """Its signature, in which every bundle is an `AnyBundle`."""
        return self._signature


def pointer(kernel: Any, returned: Any, *arguments: Any) -> Pointer:
    """Compile a kernel, or find it compiled, for these arguments, each a bundle or one of the types above.

    Raises TypeError if it does not return `returned`.
    """
    return _pointer(kernel, returned, *(getattr(argument, "_numba_type_", argument) for argument in arguments))


@cache
def _pointer(kernel: Any, returned: Any, *exact: Any) -> Pointer:
    """Cached, because numba takes 0.1 ms to describe a signature."""
    kernel.compile(exact)
    kind = types.unliteral(kernel.overloads[exact].signature.return_type)  # for kernels that always return OK
    if kind != returned:
        raise TypeError(f"{kernel.__name__} returns {kind}, not {returned}")
    shown = (AnyBundle._numba_type_ if isinstance(kind, BundleType) else kind for kind in exact)
    return Pointer(HOOKS.address(kernel, returned(*exact)), returned(*shown))
