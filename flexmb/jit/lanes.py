"""Eight copies of a number as one value of compiled code: the numbers of kernels that run eight scenes at once.

A *lane* is one of the eight numbers. A kernel whose workspace holds lanes is compiled from the same source as for
floats: operations act on all lanes, and a float operand is the same for every lane. A comparison gives a *mask*, a
boolean for each lane, on which a kernel cannot branch. Kernels that compare therefore use

    select(mask, a, b)     a where the mask is true, else b
    every(mask)            whether it is true for all lanes
    some(mask)             whether it is true for at least one
    kept(mask, a)          a where the mask is true; elsewhere NaN, which marks a failure while other lanes continue

For floats these are the conditional expression, the boolean itself, and a. A branch on `every` or `some` must be right
for all lanes. Interpreted as Python they take floats.
"""

from __future__ import annotations

import math
import operator
from math import cos, sin
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature
from numba.extending import infer_getattr, lower_builtin, lower_cast, lower_getattr, models, register_model

LANES = 8
BYTES = 8 * LANES  # size and alignment of a lane value


class LaneType(types.Type):
    """Eight float64; floats and integers are converted by repetition."""

    width = LANES
    bitwidth = 8 * BYTES

    def __init__(self) -> None:
        super().__init__(name=f"f64x{LANES}")

    def can_convert_from(self, typing: Any, other: types.Type) -> Conversion | None:
        """Numbers convert to lanes with equal values."""
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None


class MaskType(types.Type):
    """A boolean for each lane."""

    def __init__(self) -> None:
        super().__init__(name=f"b1x{LANES}")

    def can_convert_from(self, typing: Any, other: types.Type) -> Conversion | None:
        """Booleans convert to masks with equal values."""
        return Conversion.safe if isinstance(other, types.Boolean) else None


LANE, MASK = LaneType(), MaskType()
_NUMBERS = ir.VectorType(ir.DoubleType(), LANES)
_TRUTHS = ir.VectorType(ir.IntType(1), LANES)
_PLACE = ir.IntType(32)


@register_model(LaneType)
class _LaneModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _NUMBERS)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _TRUTHS)


def every(truth: Any) -> Any:
    """Whether a comparison is true, for all lanes."""
    return truth


def some(truth: Any) -> Any:
    """Whether a comparison is true, for one lane at least."""
    return truth


def select(truth: Any, a: Any, b: Any) -> Any:
    """a where a comparison is true, else b; both are computed."""
    return a if truth else b


def kept(truth: Any, a: Any) -> Any:
    """a; with lanes, NaN where the comparison is false. A kernel for floats has already returned in that case."""
    return a


def sincos(x: Any) -> Any:
    """(sin x, cos x)."""
    return sin(x), cos(x)


def sines(x: Any, sine: Any, cosine: Any, count: int) -> None:
    """Sine and cosine of the first `count` numbers of a table (n,); for floats n must be a multiple of LANES."""
    for i in range(count):
        sine[i], cosine[i] = sincos(x[i])


def repeated(builder: Any, value: Any) -> Any:
    """One number or boolean in all lanes."""
    empty = ir.Constant(ir.VectorType(value.type, LANES), ir.Undefined)
    first = builder.insert_element(empty, value, _PLACE(0))
    return builder.shuffle_vector(first, empty, ir.Constant(ir.VectorType(_PLACE, LANES), None))


@lower_cast(types.Float, LaneType)
@lower_cast(types.Integer, LaneType)
def _number_to_lanes(context, builder, given, wanted, value):
    return repeated(builder, context.cast(builder, value, given, types.float64))


@lower_cast(types.Boolean, MaskType)
def _truth_to_lanes(context, builder, given, wanted, value):
    return repeated(builder, value)


@infer_getattr
class _LaneAttribute(AttributeTemplate):
    key = LaneType

    def resolve_real(self, lane):
        return lane


@lower_getattr(LaneType, "real")
def _real(context, builder, kind, value):
    return value


def _is_lanes(*kinds: types.Type) -> bool:
    """Whether at least one is lanes, and the others can be converted to lanes."""
    return LANE in kinds and all(kind == LANE or isinstance(kind, types.Float | types.Integer) for kind in kinds)


def _is_mask(*kinds: types.Type) -> bool:
    return MASK in kinds and all(kind == MASK or isinstance(kind, types.Boolean) for kind in kinds)


def _on(operands: types.Type, fits: Any, result: types.Type, *functions: Any) -> None:
    """Declare that functions take operands of this type, to which arguments that `fits` accepts are converted."""
    for function in functions:

        @infer_global(function)
        class _Typed(AbstractTemplate):
            def generic(self, args, kws):
                if not kws and fits(*args):
                    return signature(result, *(operands for _ in args))


def _operator(instruction: str, *functions: Any) -> None:
    def lower(context, builder, sig, args):
        return getattr(builder, instruction)(*args)

    _on(LANE, _is_lanes, LANE, *functions)
    for function in functions:
        lower_builtin(function, LaneType, LaneType)(lower)


def _comparison(sign: str, function: Any, lower_ordered: bool = True) -> None:
    def lower(context, builder, sig, args):
        compare = builder.fcmp_ordered if lower_ordered else builder.fcmp_unordered
        return compare(sign, *args)

    _on(LANE, _is_lanes, MASK, function)
    lower_builtin(function, LaneType, LaneType)(lower)


def _connective(instruction: str, *functions: Any) -> None:
    def lower(context, builder, sig, args):
        return getattr(builder, instruction)(*args)

    _on(MASK, _is_mask, MASK, *functions)
    for function in functions:
        lower_builtin(function, MaskType, MaskType)(lower)


_operator("fadd", operator.add, operator.iadd)
_operator("fsub", operator.sub, operator.isub)
_operator("fmul", operator.mul, operator.imul)
_operator("fdiv", operator.truediv, operator.itruediv)
_comparison("<", operator.lt)
_comparison("<=", operator.le)
_comparison(">", operator.gt)
_comparison(">=", operator.ge)
_comparison("==", operator.eq)
_comparison("!=", operator.ne, lower_ordered=False)  # a NaN differs from everything
_connective("and_", operator.and_)
_connective("or_", operator.or_)
_on(LANE, _is_lanes, LANE, operator.neg, abs, math.sqrt, math.sin, math.cos)
_on(MASK, _is_mask, MASK, operator.invert)


@lower_builtin(operator.neg, LaneType)
def _negative(context, builder, sig, args):
    return builder.fneg(args[0])


@lower_builtin(operator.invert, MaskType)
def _opposite(context, builder, sig, args):
    return builder.not_(args[0])


@infer_global(every)
@infer_global(some)
class _Reduction(AbstractTemplate):
    def generic(self, args, kws):
        [truth] = args
        if truth == MASK or isinstance(truth, types.Boolean):
            return signature(types.boolean, truth)


@lower_builtin(every, types.Boolean)
@lower_builtin(some, types.Boolean)
def _same(context, builder, sig, args):
    return args[0]


@lower_builtin(every, MaskType)
def _every(context, builder, sig, args):
    bits = builder.bitcast(args[0], ir.IntType(LANES))
    return builder.icmp_unsigned("==", bits, bits.type(-1))


@lower_builtin(some, MaskType)
def _some(context, builder, sig, args):
    bits = builder.bitcast(args[0], ir.IntType(LANES))
    return builder.icmp_unsigned("!=", bits, bits.type(0))


@infer_global(select)
class _Select(AbstractTemplate):
    def generic(self, args, kws):
        truth, a, b = args
        if truth == MASK and (_is_lanes(LANE, a, b)):
            return signature(LANE, MASK, LANE, LANE)
        if isinstance(truth, types.Boolean):
            found = self.context.unify_pairs(a, b)
            return None if found is None else signature(found, types.boolean, found, found)


@lower_builtin(select, MaskType, LaneType, LaneType)
@lower_builtin(select, types.Boolean, types.Any, types.Any)
def _lower_select(context, builder, sig, args):
    return builder.select(*args)


@infer_global(kept)
class _Kept(AbstractTemplate):
    def generic(self, args, kws):
        truth, a = args
        if truth == MASK and _is_lanes(LANE, a):
            return signature(LANE, MASK, LANE)
        if isinstance(truth, types.Boolean):
            return signature(a, truth, a)


@lower_builtin(kept, types.Boolean, types.Any)
def _all_kept(context, builder, sig, args):
    return args[1]


@lower_builtin(kept, MaskType, LaneType)
def _lower_kept(context, builder, sig, args):
    return builder.select(args[0], args[1], ir.Constant(_NUMBERS, [ir.Constant(ir.DoubleType(), math.nan)] * LANES))
