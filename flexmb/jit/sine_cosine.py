"""Sine and cosine together, of a float or of a vector of eight floats, as inlined code.

The argument is reduced by multiples of pi/2 in three parts (Cody & Waite 1980), with the rounding error of the
reduction as a tail; the polynomials are those of fdlibm for |r| <= pi/4. The result is within one unit in the last
place while the multiple is below 2^17. There is no branch and no call, so that the processor evaluates several at the
same time; the library's functions take longer than everything else that a hinge needs to move its body.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba.core import cgutils

FARTHEST = 1e5  # the argument up to which three parts of pi/2 are enough

_PARTS = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)  # of pi/2, 33 bits each
_SINE = (  # coefficients of r^13, r^11 .. r^3
    1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06,
    -1.98412698298579493134e-04, 8.33333333332248946124e-03, -1.66666666666666324348e-01,
)  # fmt: skip
_COSINE = (  # of r^14, r^12 .. r^4
    -1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07,
    2.48015872894767294178e-05, -1.38888888888741095749e-03, 4.16666666666666019037e-02,
)  # fmt: skip
_ROUNDING = 1.5 * 2.0**52  # adding it rounds a number to an integer, which is then in the last bits of the sum

_NUMBER, _WORD = ir.DoubleType(), ir.IntType(64)


def number(kind: Any, value: float) -> Any:
    """A constant; for a vector, in all places."""
    return ir.Constant(kind, [ir.Constant(_NUMBER, value)] * kind.count if _is_vector(kind) else value)


def instruction(builder: Any, name: str, *args: Any) -> Any:
    """An LLVM intrinsic for floats or vectors of floats."""
    kind = args[0].type
    function = ir.FunctionType(kind, [kind] * len(args))
    suffix = f"v{kind.count}f64" if _is_vector(kind) else "f64"
    return builder.call(cgutils.get_or_insert_function(builder.module, function, f"llvm.{name}.{suffix}"), args)


def is_near(builder: Any, x: Any) -> Any:
    """Whether `sine_cosine` is accurate for x."""
    return builder.fcmp_ordered("<", instruction(builder, "fabs", x), number(x.type, FARTHEST))


def sine_cosine(builder: Any, x: Any) -> tuple[Any, Any]:
    """(sin x, cos x) for arguments up to FARTHEST."""

    def fma(a: Any, b: Any, c: Any) -> Any:
        return instruction(builder, "fma", a, b, c)

    def constant(value: float) -> Any:
        return number(x.type, value)

    rounded = fma(x, constant(2.0 / math.pi), constant(_ROUNDING))
    less = builder.fneg(builder.fsub(rounded, constant(_ROUNDING)))  # minus the multiple
    first = fma(less, constant(_PARTS[0]), x)
    r = fma(less, constant(_PARTS[1]), first)
    tail = fma(less, constant(_PARTS[2]), fma(less, constant(_PARTS[1]), builder.fsub(first, r)))
    z = builder.fmul(r, r)
    half = fma(z, constant(-0.5), constant(1.0))  # 1 - r^2/2, and its rounding error
    left = fma(z, constant(-0.5), builder.fsub(constant(1.0), half))
    s = fma(builder.fmul(z, r), _polynomial(builder, _SINE, z), builder.fmul(tail, half))
    c = fma(builder.fmul(z, z), _polynomial(builder, _COSINE, z), fma(builder.fneg(r), tail, left))
    return _of_quadrant(builder, builder.fadd(r, s), builder.fadd(half, c), rounded)


def _polynomial(builder: Any, coefficients: tuple[float, ...], z: Any) -> Any:
    """Horner's rule, highest power first."""
    total = number(z.type, coefficients[0])
    for coefficient in coefficients[1:]:
        total = instruction(builder, "fma", total, z, number(z.type, coefficient))
    return total


def _of_quadrant(builder: Any, s: Any, c: Any, rounded: Any) -> tuple[Any, Any]:
    """Sine and cosine of the angle, from those of its distance to a multiple of pi/2, by exchange and sign."""
    kind = s.type
    words = ir.VectorType(_WORD, kind.count) if _is_vector(kind) else _WORD

    def word(value: int) -> Any:
        return ir.Constant(words, [ir.Constant(_WORD, value)] * kind.count if _is_vector(kind) else value)

    quadrant, s, c = (builder.bitcast(value, words) for value in (rounded, s, c))
    odd = builder.sub(word(0), builder.and_(quadrant, word(1)))  # all bits, or none
    exchange = builder.and_(builder.xor(s, c), odd)

    def signed(value: Any, turned: Any) -> Any:
        """The value, negative in the quadrants whose second bit is set."""
        sign = builder.shl(builder.and_(turned, word(2)), word(62))
        return builder.bitcast(builder.xor(builder.xor(value, exchange), sign), kind)

    return signed(s, quadrant), signed(c, builder.add(quadrant, word(1)))


def _is_vector(kind: Any) -> bool:
    return isinstance(kind, ir.VectorType)
