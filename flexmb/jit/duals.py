"""A number and its derivatives along seven directions, as one value: seven columns of a Jacobian at once.

A kernel whose workspace holds such dual numbers is compiled from the same source as for floats. Sums, products,
quotients and elementary functions carry the derivatives along by the rules of calculus: nothing is approximated and
nothing cancels (forward differentiation: Griewank & Walther, Evaluating Derivatives, 2nd ed., ch. 3). The number and
its derivatives are the elements of one vector of eight, which fills a line of the cache: it is loaded and stored at
once, a sum costs one addition, and a product two multiplications, of which one adds. With eight derivatives beside the
number, in 72 bytes, an evaluation took half as long again.

The number of a result has the bits of the same operation on floats, also where it is infinite or a zero with a sign;
only a product and a sum are not fused. Comparisons use the number alone, `.real`; whether a term that is usually zero
may be left out is asked by `nonzero`.
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

RATES = LANES - 1
"""The directions of the derivatives of a dual."""


class DualType(types.Type):
    """A float64 and RATES derivatives: one vector. In arrays they are the last axis, the number first."""

    width = 1 + RATES
    bitwidth = 64 * width

    def __init__(self) -> None:
        super().__init__(name=f"dual{RATES}")

    def can_convert_from(self, typing: Any, other: types.Type) -> Conversion | None:
        """Numbers convert to duals with zero derivatives."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None

    def load(self, builder: Any, place: Any) -> Any:
        """Load from an address. Arrays of `flexmb.jit.wide_arrays` are aligned to the vector, but none needs to be."""
        return builder.load(builder.bitcast(place, _ALL.as_pointer()), align=8)

    def store(self, builder: Any, dual: Any, place: Any) -> None:
        """Store to an address likewise."""
        builder.store(dual, builder.bitcast(place, _ALL.as_pointer()), align=8)


DUAL = DualType()
_NUMBER = ir.DoubleType()
_ALL = ir.VectorType(_NUMBER, LANES)
_I32 = ir.IntType(32)
_OF_RATES = ir.Constant(ir.VectorType(ir.IntType(1), LANES), [0] + [1] * RATES)  # true for derivatives


@register_model(DualType)
class _DualModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _ALL)


def _value(builder: Any, dual: Any) -> Any:
    """The number."""
    return builder.extract_element(dual, _I32(0))


def _with(builder: Any, dual: Any, value: Any) -> Any:
    """Its derivatives with another number."""
    return builder.insert_element(dual, value, _I32(0))


def _constant(builder: Any, value: Any) -> Any:
    """A number without derivatives."""
    return builder.insert_element(ir.Constant(_ALL, None), value, _I32(0))


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
    return _constant(builder, context.cast(builder, value, given, types.float64))


@infer_getattr
class _DualAttribute(AttributeTemplate):
    key = DualType

    def resolve_real(self, dual):
        return types.float64


@lower_getattr(DualType, "real")
def _real(context, builder, kind, value):
    return _value(builder, value)


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
    """Operators from lower(builder, a, b, is_a, is_b): whether each operand is a dual, or a float."""

    def lowered(context, builder, sig, args):
        return lower(builder, *args, *(kind == DUAL for kind in sig.args))

    for function in functions:
        infer_global(function)(_Binary)
        for kinds in ((DualType, DualType), (DualType, types.Float), (types.Float, DualType)):
            lower_builtin(function, *kinds)(lowered)


def _both(builder, a, b, is_a, is_b):
    """Both operands as duals."""
    return a if is_a else _constant(builder, a), b if is_b else _constant(builder, b)


def _add(builder, a, b, is_a, is_b):
    return builder.fadd(*_both(builder, a, b, is_a, is_b))


def _subtract(builder, a, b, is_a, is_b):
    return builder.fsub(*_both(builder, a, b, is_a, is_b))


def _multiply(builder, a, b, is_a, is_b):
    if not is_a:
        return _scaled(builder, a, b)
    if not is_b:
        return _scaled(builder, b, a)
    first = _scaled(builder, _value(builder, a), b)
    both = builder.fadd(first, _scaled(builder, _value(builder, b), a))
    return builder.select(_OF_RATES, both, first)  # the number would be doubled


def _divide(builder, a, b, is_a, is_b):
    if not is_b:
        inverse = builder.fdiv(_NUMBER(1.0), b)
        return _with(builder, _scaled(builder, inverse, a), builder.fdiv(_value(builder, a), b))
    below = _value(builder, b)
    quotient = builder.fdiv(_value(builder, a) if is_a else a, below)
    inverse = builder.fdiv(_NUMBER(1.0), below)
    less = _scaled(builder, quotient, b)
    rates = builder.fsub(a, less) if is_a else builder.fneg(less)
    return _with(builder, _scaled(builder, inverse, rates), quotient)


def _unary(function: Any, lower: Any) -> None:
    """A function from lower(call, builder, x): its value and its slope; `call` calls functions of floats."""

    def lowered(context, builder, sig, args):
        found, slope = lower(_caller(context, builder), builder, _value(builder, args[0]))
        return _with(builder, _scaled(builder, slope, args[0]), found)

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
    return builder.fneg(args[0])


@lower_builtin(math.atan2, DualType, DualType)
def _arc_tangent(context, builder, sig, args):
    y, x = (_value(builder, each) for each in args)
    inverse = builder.fdiv(_NUMBER(1.0), builder.fadd(builder.fmul(x, x), builder.fmul(y, y)))
    rates = _scaled(builder, inverse, builder.fsub(_scaled(builder, x, args[0]), _scaled(builder, y, args[1])))
    return _with(builder, rates, _caller(context, builder)(math.atan2, y, x))


@infer_global(sincos)
class _SineCosine(AbstractTemplate):
    def generic(self, args, kws):
        if args == (DUAL,):
            return signature(types.UniTuple(DUAL, 2), DUAL)


@lower_builtin(sincos, DualType)
def _sine_cosine(context, builder, sig, args):
    x = _value(builder, args[0])
    both = context.get_function(sincos, signature(types.UniTuple(types.float64, 2), types.float64))(builder, [x])
    s, c = cgutils.unpack_tuple(builder, both)
    sine = _with(builder, _scaled(builder, c, args[0]), s)
    cosine = _with(builder, _scaled(builder, builder.fneg(s), args[0]), c)
    return context.make_tuple(builder, sig.return_type, (sine, cosine))


def _place(builder: Any, lane: Any) -> Any:
    """Where the vector has the derivative along this direction."""
    return builder.add(lane, lane.type(1))


@infer_global(seeded)
class _Seeded(AbstractTemplate):
    def generic(self, args, kws):
        if args[0] == DUAL:
            return signature(DUAL, DUAL, types.int32)


@lower_builtin(seeded, DualType, types.Integer)
def _lower_seeded(context, builder, sig, args):
    return builder.insert_element(args[0], _NUMBER(1.0), _place(builder, args[1]))


@infer_global(rate)
class _Rate(AbstractTemplate):
    def generic(self, args, kws):
        if args[0] == DUAL:
            return signature(types.float64, DUAL, types.int32)


@lower_builtin(rate, DualType, types.Integer)
def _lower_rate(context, builder, sig, args):
    return builder.extract_element(args[0], _place(builder, args[1]))


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
    different = builder.fcmp_unordered("!=", args[0], ir.Constant(_ALL, None))
    bits = builder.bitcast(different, ir.IntType(LANES))
    return builder.icmp_unsigned("!=", bits, bits.type(0))
