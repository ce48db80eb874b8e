"""Kernels as arguments of kernels, by address: who takes one is compiled once, for all that have its signature.

Bundles are passed on to it as `AnyBundle`, whose type says nothing of what is in them. A call through an address costs
some 20 ns; it is made where a kernel does a thousand times that, as an integrator that evaluates equations of motion.
An integrator is compiled in some 2 s of processor time: once, instead of once for each algorithm and kind of scene.
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


class Pointer(WrapperAddressProtocol):  # type: ignore[misc]
    """The address of a kernel, for numba: what it is asked for when a kernel takes this as an argument."""

    def __init__(self, address: int, signature: Any) -> None:
        self._address, self._signature = address, signature

    def __wrapper_address__(self) -> int:
        return self._address

    def signature(self) -> Any:
        """Its signature, in which every bundle is an `AnyBundle`."""
        return self._signature


def pointer(kernel: Any, returned: Any, *arguments: Any) -> Pointer:
    """Compile a kernel, or find it compiled, for the types of these arguments: of the constants above, or bundles.

    Raises TypeError where it returns something else than `returned`.
    """
    return _pointer(kernel, returned, *(getattr(argument, "_numba_type_", argument) for argument in arguments))


@cache
def _pointer(kernel: Any, returned: Any, *exact: Any) -> Pointer:
    """Kept, because numba takes a tenth of a millisecond to describe a signature."""
    kernel.compile(exact)
    kind = types.unliteral(kernel.overloads[exact].signature.return_type)  # a kernel that only ever returns OK
    if kind != returned:
        raise TypeError(f"{kernel.__name__} returns {kind}, not {returned}")
    shown = (AnyBundle._numba_type_ if isinstance(kind, BundleType) else kind for kind in exact)
    return Pointer(HOOKS.address(kernel, returned(*exact)), returned(*shown))
