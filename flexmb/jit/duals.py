"""A number and its derivatives along eight directions, as one value: eight columns of a Jacobian at once.

A kernel whose workspace holds such dual numbers is compiled from the same source as for floats. Sums, products,
quotients and elementary functions carry the derivatives along by the rules of calculus: nothing is approximated and
nothing cancels (forward differentiation: Griewank & Walther, Evaluating Derivatives, 2nd ed., ch. 3). The derivatives
are the lanes of one vector, so that a product costs one scalar multiplication and two of vectors. Comparisons use the
number alone, `.real`; whether a term that is usually zero may be left out is asked by `nonzero`.
"""

from __future__ import annotations

import math
import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature
from numba.extending import infer_getattr, lower_builtin, lower_cast, lower_getattr, models, register_model

from flexmb.jit.lanes import LANE, LANES, MASK, LaneType, repeated, sincos


class DualType(types.Type):
    """A float64 and LANES derivatives; in arrays the last axis: the number first."""

    width = 1 + LANES
    bitwidth = 64 * width

    def __init__(self) -> None:
        super().__init__(name=f"dual{LANES}")

    def can_convert_from(self, typing: Any, other: types.Type) -> Conversion | None:
        """Numbers convert to duals with zero derivatives."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None

    def load(self, builder: Any, place: Any) -> Any:
        """Load from an address, which need not be aligned for vector instructions."""
        value, rates = _places(builder, place)
        return _dual(builder, builder.load(value), builder.load(rates, align=8))

    def store(self, builder: Any, dual: Any, place: Any) -> None:
        """Store to such an address."""
        value, rates = _places(builder, place)
        builder.store(builder.extract_value(dual, 0), value)
        builder.store(builder.extract_value(dual, 1), rates, align=8)


DUAL = DualType()
_NUMBER = ir.DoubleType()
_RATES = ir.VectorType(_NUMBER, LANES)


@register_model(DualType)
class _DualModel(models.StructModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, [("value", types.float64), ("rates", LANE)])


def _places(builder: Any, place: Any) -> tuple[Any, Any]:
    """Addresses of the number and of its derivatives."""
    value = builder.bitcast(place, _NUMBER.as_pointer())
    rates = builder.gep(value, [ir.IntType(64)(1)], inbounds=True)
    return value, builder.bitcast(rates, _RATES.as_pointer())


def _dual(builder: Any, value: Any, rates: Any) -> Any:
    empty = ir.Constant(ir.LiteralStructType([_NUMBER, _RATES]), ir.Undefined)
    return builder.insert_value(builder.insert_value(empty, value, 0), rates, 1)


def _parts(builder: Any, dual: Any) -> tuple[Any, Any]:
    return builder.extract_value(dual, 0), builder.extract_value(dual, 1)


def _scaled(builder: Any, factor: Any, rates: Any) -> Any:
    return builder.fmul(repeated(builder, factor), rates)


def seeded(x: Any, lane: int) -> Any:
    """x with the derivative along the direction of this lane set to one; a float stays as it is."""
    return x


def rate(x: Any, lane: int) -> Any:
    """Derivative of x along the direction of this lane; zero for a float."""
    return 0.0


def nonzero(x: Any) -> Any:
    """Whether x, or for a dual a derivative of it, differs from zero; a mask for lanes. Where not, a term that has x as
    a factor may be left out."""
    return x != 0.0


@lower_cast(types.Float, DualType)
@lower_cast(types.Integer, DualType)
def _number_to_dual(context, builder, given, wanted, value):
    return _dual(builder, context.cast(builder, value, given, types.float64), ir.Constant(_RATES, None))


@infer_getattr
class _DualAttribute(AttributeTemplate):
    key = DualType

    def resolve_real(self, dual):
        return types.float64


@lower_getattr(DualType, "real")
def _real(context, builder, kind, value):
    return builder.extract_value(value, 0)


class _Binary(AbstractTemplate):
    """Types of operators on two duals, or on a dual and a constant number."""

    def generic(self, args, kws):
        if DUAL in args and all(kind == DUAL or isinstance(kind, types.Float | types.Integer) for kind in args):
            return signature(DUAL, *(DUAL if kind == DUAL else types.float64 for kind in args))


class _Unary(AbstractTemplate):
    def generic(self, args, kws):
        if args == (DUAL,):
            return signature(DUAL, DUAL)


def _binary(lower: Any, *functions: Any) -> None:
    """Operators (a, b) from lower(builder, a, da, b, db), where the derivatives of a constant are None."""

    def lowered(context, builder, sig, args):
        parts = [_parts(builder, x) if kind == DUAL else (x, None) for kind, x in zip(sig.args, args, strict=True)]
        return _dual(builder, *lower(builder, *parts[0], *parts[1]))

    for function in functions:
        infer_global(function)(_Binary)
        for kinds in ((DualType, DualType), (DualType, types.Float), (types.Float, DualType)):
            lower_builtin(function, *kinds)(lowered)


def _add(builder, a, da, b, db):
    return builder.fadd(a, b), db if da is None else da if db is None else builder.fadd(da, db)


def _subtract(builder, a, da, b, db):
    return builder.fsub(a, b), builder.fneg(db) if da is None else da if db is None else builder.fsub(da, db)


def _multiply(builder, a, da, b, db):
    terms = [_scaled(builder, factor, rates) for factor, rates in ((b, da), (a, db)) if rates is not None]
    return builder.fmul(a, b), terms[0] if len(terms) == 1 else builder.fadd(*terms)


def _divide(builder, a, da, b, db):
    quotient = builder.fdiv(a, b)
    inverse = builder.fdiv(_NUMBER(1.0), b)
    if db is None:
        return quotient, _scaled(builder, inverse, da)
    less = _scaled(builder, quotient, db)
    return quotient, _scaled(builder, inverse, builder.fneg(less) if da is None else builder.fsub(da, less))


def _unary(function: Any, lower: Any) -> None:
    """A function from lower(call, builder, x): its value and its slope; `call` calls functions of floats."""

    def lowered(context, builder, sig, args):
        value, rates = _parts(builder, args[0])
        found, slope = lower(_caller(context, builder), builder, value)
        return _dual(builder, found, _scaled(builder, slope, rates))

    infer_global(function)(_Unary)
    lower_builtin(function, DualType)(lowered)


def _caller(context: Any, builder: Any) -> Any:
    def call(function: Any, *args: Any) -> Any:
        of = signature(types.float64, *[types.float64] * len(args))
        return context.get_function(function, of)(builder, args)

    return call


def _square_root(call, builder, x):
    root = call(math.sqrt, x)
    return root, builder.fdiv(_NUMBER(0.5), root)


def _sine(call, builder, x):
    return call(math.sin, x), call(math.cos, x)


def _cosine(call, builder, x):
    return call(math.cos, x), builder.fneg(call(math.sin, x))


def _exponential(call, builder, x):
    power = call(math.exp, x)
    return power, power


_binary(_add, operator.add, operator.iadd)
_binary(_subtract, operator.sub, operator.isub)
_binary(_multiply, operator.mul, operator.imul)
_binary(_divide, operator.truediv, operator.itruediv)
_unary(math.sqrt, _square_root)
_unary(math.sin, _sine)
_unary(math.cos, _cosine)
_unary(math.exp, _exponential)
infer_global(operator.neg)(_Unary)
infer_global(math.atan2)(_Binary)


@lower_builtin(operator.neg, DualType)
def _negative(context, builder, sig, args):
    value, rates = _parts(builder, args[0])
    return _dual(builder, builder.fneg(value), builder.fneg(rates))


@lower_builtin(math.atan2, DualType, DualType)
def _arc_tangent(context, builder, sig, args):
    (y, dy), (x, dx) = (_parts(builder, dual) for dual in args)
    inverse = builder.fdiv(_NUMBER(1.0), builder.fadd(builder.fmul(x, x), builder.fmul(y, y)))
    rates = _scaled(builder, inverse, builder.fsub(_scaled(builder, x, dy), _scaled(builder, y, dx)))
    return _dual(builder, _caller(context, builder)(math.atan2, y, x), rates)


@infer_global(sincos)
class _SineCosine(AbstractTemplate):
    def generic(self, args, kws):
        if args == (DUAL,):
            return signature(types.UniTuple(DUAL, 2), DUAL)


@lower_builtin(sincos, DualType)
def _sine_cosine(context, builder, sig, args):
    x, dx = _parts(builder, args[0])
    both = context.get_function(sincos, signature(types.UniTuple(types.float64, 2), types.float64))(builder, [x])
    s, c = cgutils.unpack_tuple(builder, both)
    sine = _dual(builder, s, _scaled(builder, c, dx))
    cosine = _dual(builder, c, _scaled(builder, builder.fneg(s), dx))
    return context.make_tuple(builder, sig.return_type, (sine, cosine))


@infer_global(seeded)
class _Seeded(AbstractTemplate):
    def generic(self, args, kws):
        if args[0] == DUAL:
            return signature(DUAL, DUAL, types.int32)


@lower_builtin(seeded, DualType, types.Integer)
def _lower_seeded(context, builder, sig, args):
    value, rates = _parts(builder, args[0])
    return _dual(builder, value, builder.insert_element(rates, _NUMBER(1.0), args[1]))


@infer_global(rate)
class _Rate(AbstractTemplate):
    def generic(self, args, kws):
        if args[0] == DUAL:
            return signature(types.float64, DUAL, types.int32)


@lower_builtin(rate, DualType, types.Integer)
def _lower_rate(context, builder, sig, args):
    return builder.extract_element(builder.extract_value(args[0], 1), args[1])


@infer_global(nonzero)
class _Nonzero(AbstractTemplate):
    def generic(self, args, kws):
        [x] = args
        if x == LANE:
            return signature(MASK, LANE)
        if isinstance(x, types.Complex):
            return None  # see `flexmb.jit.complex_numbers`
        return signature(types.boolean, x if x == DUAL else types.float64)


@lower_builtin(nonzero, types.Float)
@lower_builtin(nonzero, LaneType)
def _lower_nonzero(context, builder, sig, args):
    return builder.fcmp_unordered("!=", args[0], ir.Constant(args[0].type, 0.0 if sig.args[0] != LANE else None))


@lower_builtin(nonzero, DualType)
def _nonzero_dual(context, builder, sig, args):
    value, rates = _parts(builder, args[0])
    different = builder.fcmp_unordered("!=", rates, ir.Constant(_RATES, None))
    bits = builder.bitcast(different, ir.IntType(LANES))
    return builder.or_(
        builder.fcmp_unordered("!=", value, _NUMBER(0.0)), builder.icmp_unsigned("!=", bits, bits.type(0))
    )
