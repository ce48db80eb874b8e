"""Elementary functions of lanes: the square root by one instruction, sine and cosine together, the rest lane by lane.

Sine and cosine of floats are here too. Arguments far from zero, infinity and NaN are passed to the library's functions,
lane by lane.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from flexmb.jit.lanes import LANE, LANES, LaneType, sincos, sines
from flexmb.jit.sine_cosine import instruction, is_near, number, sine_cosine
from flexmb.jit.tables import TableType, load_number, store_number

_NUMBERS = ir.VectorType(ir.DoubleType(), LANES)


def _lane_by_lane(context: Any, builder: Any, function: Any, *args: Any) -> Any:
    """The library's function of one lane after the other."""
    called = _library(context, builder, function, len(args))
    result = cgutils.alloca_once(builder, _NUMBERS)
    with cgutils.for_range(builder, ir.IntType(64)(LANES)) as loop:
        value = called([builder.extract_element(arg, loop.index) for arg in args])
        builder.store(builder.insert_element(builder.load(result), value, loop.index), result)
    return builder.load(result)


def _library(context: Any, builder: Any, function: Any, count: int) -> Any:
    """A library function of `count` floats, to be called with their values."""
    called = context.get_function(function, signature(types.float64, *[types.float64] * count))
    return lambda args: called(builder, args)


@infer_global(sincos)
class _SinCos(AbstractTemplate):
    def generic(self, args, kws):
        if args in ((LANE,), (types.float64,)):
            return signature(types.UniTuple(args[0], 2), *args)


@lower_builtin(sincos, LaneType)
@lower_builtin(sincos, types.Float)
def _sincos(context, builder, sig, args):
    both = _both if sig.args == (LANE,) else _both_of_one
    return context.make_tuple(builder, sig.return_type, both(context, builder, *args))


@infer_global(sines)
class _Sines(AbstractTemplate):
    def generic(self, args, kws):
        *tables, count = args
        if all(isinstance(kind, TableType) for kind in tables) and isinstance(count, types.Integer):
            return signature(types.none, *tables, types.intp)


@lower_builtin(sines, TableType, TableType, TableType, types.Integer)
def _sines(context, builder, sig, args):
    """Floats are loaded from their tables as lanes."""
    kind, count, word = sig.args[0].dtype, args[3], ir.IntType(64)
    each, stride = (LANE, LANES) if kind == types.float64 else (kind, 1)
    align = 8 if kind == types.float64 else None
    function = context.get_function(sincos, signature(types.UniTuple(each, 2), each))
    with cgutils.for_range(builder, builder.udiv(builder.add(count, word(stride - 1)), word(stride))) as loop:
        place = builder.mul(loop.index, word(stride * kind.bitwidth // 8))
        x, *results = (builder.gep(builder.extract_value(table, 0), [place], inbounds=True) for table in args[:3])
        both = cgutils.unpack_tuple(builder, function(builder, [load_number(context, builder, each, x, align)]))
        for value, result in zip(both, results, strict=True):
            store_number(context, builder, each, value, result, align)
    return context.get_dummy_value()


def _both(context: Any, builder: Any, x: Any) -> tuple[Any, Any]:
    """(sin x, cos x). The result of a lane does not depend on the others: only far ones use the library."""
    near = is_near(builder, x)
    places = [cgutils.alloca_once(builder, _NUMBERS) for _ in range(2)]
    for place, value in zip(places, sine_cosine(builder, builder.select(near, x, number(_NUMBERS, 0.0))), strict=True):
        builder.store(value, place)
    bits = builder.bitcast(near, ir.IntType(LANES))
    with (
        builder.if_then(builder.icmp_unsigned("!=", bits, bits.type(-1)), likely=False),
        cgutils.for_range(builder, ir.IntType(64)(LANES)) as loop,
        builder.if_then(builder.not_(builder.extract_element(near, loop.index))),
    ):
        far = builder.extract_element(x, loop.index)
        for place, function in zip(places, (math.sin, math.cos), strict=True):
            value = _library(context, builder, function, 1)([far])
            builder.store(builder.insert_element(builder.load(place), value, loop.index), place)
    sine, cosine = map(builder.load, places)
    return sine, cosine


def _both_of_one(context: Any, builder: Any, x: Any) -> tuple[Any, Any]:
    """(sin x, cos x) of a float."""
    places = [cgutils.alloca_once_value(builder, value) for value in sine_cosine(builder, x)]
    with builder.if_then(builder.not_(is_near(builder, x)), likely=False):
        for place, function in zip(places, (math.sin, math.cos), strict=True):
            builder.store(_library(context, builder, function, 1)([x]), place)
    sine, cosine = map(builder.load, places)
    return sine, cosine


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
    return instruction(builder, "sqrt", args[0])


@lower_builtin(abs, LaneType)
def _absolute(context, builder, sig, args):
    return instruction(builder, "fabs", args[0])
