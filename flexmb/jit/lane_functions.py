"""Elementary functions of lanes: the square root by one instruction, sine and cosine together, the rest lane by lane.

Sine and cosine reduce by multiples of pi/2 in three parts (Cody & Waite 1980), then take the polynomials of fdlibm for
|r| <= pi/4. The result is within two units in the last place while the multiple is below 2^17. Arguments beyond,
infinite ones and NaN go to the library's functions, lane by lane.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from flexmb.jit.lanes import LANE, LANES, LaneType, sincos

_FARTHEST = 1e5  # the argument up to which three parts of pi/2 are enough
_PARTS = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624879595063154e-21)  # of pi/2, 33 bits each
_SINE = (  # coefficients of r^13, r^11 .. r^3
    1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06,
    -1.98412698298579493134e-04, 8.33333333332248946124e-03, -1.66666666666666324348e-01,
)  # fmt: skip
_COSINE = (  # of r^14, r^12 .. r^4
    -1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07,
    2.48015872894767294178e-05, -1.38888888888741095749e-03, 4.16666666666666019037e-02,
)  # fmt: skip

_NUMBERS = ir.VectorType(ir.DoubleType(), LANES)
_WORDS = ir.VectorType(ir.IntType(64), LANES)


def _number(value: float) -> Any:
    return ir.Constant(_NUMBERS, [ir.Constant(ir.DoubleType(), value)] * LANES)


def _word(value: int) -> Any:
    return ir.Constant(_WORDS, [ir.Constant(ir.IntType(64), value)] * LANES)


def _instruction(builder: Any, name: str, *args: Any) -> Any:
    """An instruction that LLVM has for vectors."""
    kind = ir.FunctionType(_NUMBERS, [_NUMBERS] * len(args))
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64"), args)


def _polynomial(builder: Any, coefficients: tuple[float, ...], z: Any) -> Any:
    """Horner's rule, highest power first."""
    total = _number(coefficients[0])
    for coefficient in coefficients[1:]:
        total = _instruction(builder, "fma", total, z, _number(coefficient))
    return total


def _near(builder: Any, x: Any) -> tuple[Any, Any]:
    """(sin x, cos x) of arguments that are not far from zero."""
    multiple = _instruction(builder, "rint", builder.fmul(x, _number(2.0 / math.pi)))
    r = x
    for part in _PARTS:
        r = _instruction(builder, "fma", builder.fneg(multiple), _number(part), r)
    z = builder.fmul(r, r)
    s = _instruction(builder, "fma", builder.fmul(_polynomial(builder, _SINE, z), z), r, r)
    half = _instruction(builder, "fma", z, _number(-0.5), _number(1.0))
    c = _instruction(builder, "fma", builder.fmul(z, z), _polynomial(builder, _COSINE, z), half)
    quadrant = builder.fptosi(multiple, _WORDS)
    swapped = builder.icmp_signed("!=", builder.and_(quadrant, _word(1)), _word(0))

    def signed(value: Any, turned: Any) -> Any:
        """The value, negative in the quadrants whose second bit is set."""
        sign = builder.shl(builder.and_(turned, _word(2)), _word(62))
        return builder.bitcast(builder.xor(builder.bitcast(value, _WORDS), sign), _NUMBERS)

    sine = signed(builder.select(swapped, c, s), quadrant)
    return sine, signed(builder.select(swapped, s, c), builder.add(quadrant, _word(1)))


def _lane_by_lane(context: Any, builder: Any, function: Any, *args: Any) -> Any:
    """The library's function of one lane after the other."""
    called = _library(context, builder, function, len(args))
    result = cgutils.alloca_once(builder, _NUMBERS)
    with cgutils.for_range(builder, ir.IntType(64)(LANES)) as loop:
        value = called([builder.extract_element(arg, loop.index) for arg in args])
        builder.store(builder.insert_element(builder.load(result), value, loop.index), result)
    return builder.load(result)


def _library(context: Any, builder: Any, function: Any, count: int) -> Any:
    """A function of `count` floats, to be called with their values."""
    called = context.get_function(function, signature(types.float64, *[types.float64] * count))
    return lambda args: called(builder, args)


@infer_global(sincos)
class _SinCos(AbstractTemplate):
    def generic(self, args, kws):
        if args == (LANE,):
            return signature(types.UniTuple(LANE, 2), LANE)


def _both(context: Any, builder: Any, x: Any) -> tuple[Any, Any]:
    """(sin x, cos x). What one lane gets does not depend on the others: far ones are put in by themselves."""
    is_near = builder.fcmp_ordered("<", _instruction(builder, "fabs", x), _number(_FARTHEST))
    places = [cgutils.alloca_once(builder, _NUMBERS) for _ in range(2)]
    for place, value in zip(places, _near(builder, builder.select(is_near, x, _number(0.0))), strict=True):
        builder.store(value, place)
    near = builder.bitcast(is_near, ir.IntType(LANES))
    with (
        builder.if_then(builder.icmp_unsigned("!=", near, near.type(-1)), likely=False),
        cgutils.for_range(builder, ir.IntType(64)(LANES)) as loop,
        builder.if_then(builder.not_(builder.extract_element(is_near, loop.index))),
    ):
        far = builder.extract_element(x, loop.index)
        for place, function in zip(places, (math.sin, math.cos), strict=True):
            value = _library(context, builder, function, 1)([far])
            builder.store(builder.insert_element(builder.load(place), value, loop.index), place)
    sine, cosine = map(builder.load, places)
    return sine, cosine


@lower_builtin(sincos, LaneType)
def _sincos(context, builder, sig, args):
    return context.make_tuple(builder, sig.return_type, _both(context, builder, *args))


@lower_builtin(math.sin, LaneType)
def _sin(context, builder, sig, args):
    return _both(context, builder, *args)[0]


@lower_builtin(math.cos, LaneType)
def _cos(context, builder, sig, args):
    return _both(context, builder, *args)[1]


@infer_global(math.atan2)
class _ArcTangent(AbstractTemplate):
    def generic(self, args, kws):
        if LANE in args:
            return signature(LANE, LANE, LANE)


@lower_builtin(math.atan2, LaneType, LaneType)
def _arc_tangent(context, builder, sig, args):
    return _lane_by_lane(context, builder, math.atan2, *args)


@lower_builtin(math.sqrt, LaneType)
def _square_root(context, builder, sig, args):
    return _instruction(builder, "sqrt", args[0])


@lower_builtin(abs, LaneType)
def _absolute(context, builder, sig, args):
    return _instruction(builder, "fabs", args[0])
