"""Complex numbers as the numbers of kernels: elementary functions that numba has for them under other names only.

A kernel whose workspace holds complex numbers is compiled from the same source as for floats. It solves the equations
of implicit methods, whose matrices are complex (`flexmb.entry.stiff_part`). Comparisons use the real part, `.real`.
"""

from __future__ import annotations

import cmath
import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from flexmb.jit.duals import nonzero
from flexmb.jit.lanes import sincos

COMPLEX = types.complex128
WIDTH = 2  # floats of a complex number


class _OfOne(AbstractTemplate):
    """Functions of one complex number."""

    def generic(self, args, kws):
        return signature(COMPLEX, COMPLEX) if args == (COMPLEX,) else None


@infer_global(math.sqrt)
class _ComplexSquareRoot(_OfOne):
    pass


@infer_global(sincos)
class _ComplexSineCosine(AbstractTemplate):
    def generic(self, args, kws):
        return signature(types.UniTuple(COMPLEX, 2), COMPLEX) if args == (COMPLEX,) else None


def _library(context: Any, builder: Any, function: Any, x: Any) -> Any:
    return context.get_function(function, signature(COMPLEX, COMPLEX))(builder, [x])


@lower_builtin(math.sqrt, types.Complex)
def _sqrt(context, builder, sig, args):
    return _library(context, builder, cmath.sqrt, *args)


@lower_builtin(sincos, types.Complex)
def _sincos(context, builder, sig, args):
    both = [_library(context, builder, function, *args) for function in (cmath.sin, cmath.cos)]
    return context.make_tuple(builder, sig.return_type, both)


@infer_global(nonzero)
class _ComplexNonzero(AbstractTemplate):
    def generic(self, args, kws):
        return signature(types.boolean, COMPLEX) if args == (COMPLEX,) else None


@lower_builtin(nonzero, types.Complex)
def _lower_nonzero(context, builder, sig, args):
    zero = ir.Constant(ir.DoubleType(), 0.0)
    parts = [builder.fcmp_unordered("!=", builder.extract_value(args[0], i), zero) for i in range(WIDTH)]
    return builder.or_(*parts)
