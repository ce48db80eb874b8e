"""Eight neighbouring floats of a row as one value: vector instructions for long sums over the modes of one scene.

A *strip* of a workspace of floats is a value of `flexmb.jit.lanes` whose lanes are elements n .. n + 7 of a row. In a
workspace of lanes or duals, whose numbers are vectors already, a strip is one element. The same source serves both:

    moved = ZERO6
    for n in range(0, modes, width(w)):
        moved = axpy6(strip(w, w.eta[k], n), strips6(w, shapes, n), moved)
    moved = total6(w, moved)

The rows of tables that are read in strips, also of constants, are padded with zeros to a whole number of strips
(`whole`). Interpreted as Python every strip is one element.
"""

from __future__ import annotations

import operator
from math import prod
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from flexmb.jit.bundle import BundleType, is_long
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import BYTES, LANE, LANES, repeated
from flexmb.jit.tables import WORD, TableType, load_number, store_number
from flexmb.jit.transposition import transposed
from flexmb.typing import Real

_STRIP = ir.VectorType(ir.DoubleType(), LANES)
_PLACE = ir.IntType(32)
_PLACES = ir.Constant(ir.VectorType(WORD, LANES), list(range(LANES)))
ROW = LANES  # length of rows with six strips as columns


def whole(n: int) -> int:
    """The next multiple of a strip's length."""
    return -(-n // LANES) * LANES


def strip_zeros(shape: tuple[int, ...]) -> Real:
    """Zeros at an address that is aligned for strips."""
    size = 8 * prod(shape)
    room = np.zeros(size + BYTES, np.uint8)
    start = -room.ctypes.data % BYTES
    return room[start : start + size].view(np.float64).reshape(shape)


def width(w: Any) -> int:
    """Number of elements of a strip of the workspace w; in kernels a constant."""
    return 1


@helper
def start(w, n):
    """The first element of the strip that contains element n of a row."""
    return n - n % width(w)


def strip(w: Any, row: Any, n: int) -> Any:
    """The strip of w that starts at row[n]."""
    return row[n]


def part(w: Any, row: Any, first: int, n: int, count: int) -> Any:
    """The strip of w from element n of the `count` numbers that start at row[first]; zeros beyond these."""
    return row[first + n]


def put(w: Any, row: Any, n: int, x: Any) -> None:
    """Write the strip x, or a number for all its elements, to row[n]."""
    row[n] = x


def total(w: Any, x: Any) -> Any:
    """The sum over the elements of a strip of w."""
    return x


def after(w: Any, x: Any, n: int, i: int) -> Any:
    """The strip x, which starts at n of its row, with zeros up to and including element i of the row."""
    return x if n > i else 0.0


def put_across(w: Any, a: Any, n: int, V: Any) -> None:
    """Write six strips, given as two triples, as columns of a from row n; the last two of eight columns are zero.

    With strips of one element, only the first six places of row n are written.
    """
    a[n, 0], a[n, 1], a[n, 2] = V[0]
    a[n, 3], a[n, 4], a[n, 5] = V[1]


def add_across(w: Any, a: Any, n: int, V: Any) -> None:
    """The same, added to the present values."""
    for i in range(6):
        a[n, i] += V[i // 3][i % 3]


def with_seventh(w: Any, x: Any, number: Any) -> Any:
    """The strip x of floats with another number in place of its seventh element."""
    raise TypeError("strips of one element have no seventh")


@infer_global(width)
class _Width(AbstractTemplate):
    def generic(self, args, kws):
        if isinstance(args[0], BundleType):
            return signature(types.intp, *args)


@lower_builtin(width, BundleType)
def _lower_width(context, builder, sig, args):
    return WORD(LANES if is_long(sig.args[0]) else 1)


def _is_place(w: types.Type, row: types.Type, n: types.Type) -> bool:
    return (
        isinstance(w, BundleType)
        and isinstance(row, TableType)
        and row.ndim == 1
        and isinstance(n, types.Integer)
        and (row.dtype == types.float64 or not is_long(w))
    )


@infer_global(strip)
class _Strip(AbstractTemplate):
    def generic(self, args, kws):
        if _is_place(*args):
            w, row, _ = args
            return signature(LANE if is_long(w) else row.dtype, w, row, types.intp)


@infer_global(part)
class _Part(AbstractTemplate):
    def generic(self, args, kws):
        if _is_place(*args[:3]) and all(isinstance(each, types.Integer) for each in args[3:]):
            w, row = args[:2]
            return signature(LANE if is_long(w) else row.dtype, w, row, *[types.intp] * 3)


@infer_global(put)
class _Put(AbstractTemplate):
    def generic(self, args, kws):
        if _is_place(*args[:3]):
            w, row = args[:2]
            return signature(types.none, w, row, types.intp, LANE if is_long(w) else row.dtype)


def _place(builder: Any, row: types.Type, value: Any, n: Any) -> Any:
    offset = builder.mul(n, WORD(row.dtype.bitwidth // 8), flags=["nsw"])
    return builder.gep(builder.extract_value(value, 0), [offset], inbounds=True)


@lower_builtin(strip, BundleType, TableType, types.Integer)
def _lower_strip(context, builder, sig, args):
    w, row, _ = sig.args
    place = _place(builder, row, args[1], args[2])
    if is_long(w):
        return builder.load(builder.bitcast(place, _STRIP.as_pointer()), align=8)
    return load_number(context, builder, row.dtype, place)


@lower_builtin(part, BundleType, TableType, types.Integer, types.Integer, types.Integer)
def _lower_part(context, builder, sig, args):
    """Elements beyond the `count` numbers are not read."""
    w, row = sig.args[:2]
    _, value, first, n, number = args
    place = _place(builder, row, value, builder.add(first, n))
    if not is_long(w):
        return load_number(context, builder, row.dtype, place)
    there = builder.icmp_signed("<", _PLACES, repeated(builder, builder.sub(number, n)))
    pointer, nothing = builder.bitcast(place, _STRIP.as_pointer()), ir.Constant(_STRIP, None)
    kind = ir.FunctionType(_STRIP, [pointer.type, _PLACE, there.type, _STRIP])
    load = cgutils.get_or_insert_function(builder.module, kind, f"llvm.masked.load.v{LANES}f64.p0")
    return builder.call(load, [pointer, _PLACE(8), there, nothing])


@lower_builtin(put, BundleType, TableType, types.Integer, types.Any)
def _lower_put(context, builder, sig, args):
    w, row = sig.args[:2]
    place = _place(builder, row, args[1], args[2])
    if is_long(w):
        builder.store(args[3], builder.bitcast(place, _STRIP.as_pointer()), align=8)
    else:
        store_number(context, builder, row.dtype, args[3], place)
    return context.get_dummy_value()


@infer_global(total)
class _Total(AbstractTemplate):
    def generic(self, args, kws):
        w, x = args
        if isinstance(w, BundleType) and is_long(w):
            return signature(types.float64, w, LANE) if x == LANE else None
        return signature(x, w, x)


@lower_builtin(total, BundleType, types.Any)
def _lower_total(context, builder, sig, args):
    """Pairwise: the upper half is added to the lower half until one element is left."""
    if not is_long(sig.args[0]):
        return args[1]
    x, length = args[1], LANES
    while length > 1:
        length //= 2
        low, high = (
            builder.shuffle_vector(x, x, ir.Constant(ir.VectorType(_PLACE, length), list(range(at, at + length))))
            for at in (0, length)
        )
        x = builder.fadd(low, high)
    return builder.extract_element(x, _PLACE(0))


@infer_global(after)
class _After(AbstractTemplate):
    def generic(self, args, kws):
        w, x, n, i = args
        if isinstance(w, BundleType) and isinstance(n, types.Integer) and isinstance(i, types.Integer):
            return signature(LANE if is_long(w) else x, w, LANE if is_long(w) else x, types.intp, types.intp)


@lower_builtin(after, BundleType, types.Any, types.Integer, types.Integer)
def _lower_after(context, builder, sig, args):
    w, x = sig.args[:2]
    _, value, n, i = args
    zero = context.cast(builder, ir.Constant(ir.DoubleType(), 0.0), types.float64, x)
    if not is_long(w):
        return builder.select(builder.icmp_signed(">", n, i), value, zero)
    return builder.select(builder.icmp_signed(">", _PLACES, repeated(builder, builder.sub(i, n))), value, zero)


def _is_six(w: types.Type, V: types.Type) -> bool:
    """Whether V is a pair of triples of strips or numbers."""
    return isinstance(V, types.BaseTuple) and [getattr(part, "count", 0) for part in V] == [3, 3]


class _Across(AbstractTemplate):
    def generic(self, args, kws):
        w, a, n, V = args
        fits = isinstance(w, BundleType) and isinstance(a, TableType) and a.ndim == 2 and isinstance(n, types.Integer)
        if fits and _is_six(w, V) and (a.dtype == types.float64 or not is_long(w)):
            three = types.UniTuple(LANE if is_long(w) else a.dtype, 3)
            return signature(types.none, w, a, types.intp, types.UniTuple(three, 2))


infer_global(put_across)(_Across)
infer_global(add_across)(_Across)


def _across(context: Any, builder: Any, sig: Any, args: Any, added: bool) -> Any:
    w, a = sig.args[:2]
    number = LANE if is_long(w) else a.dtype
    columns = [builder.extract_value(args[3], [i // 3, i % 3]) for i in range(6)]
    size, length = a.dtype.bitwidth // 8, builder.extract_value(args[1], [1, 1])

    def place(row: int, column: int) -> Any:
        at = builder.add(builder.mul(builder.add(args[2], WORD(row)), length), WORD(column))
        return builder.gep(builder.extract_value(args[1], 0), [builder.mul(at, WORD(size))], inbounds=True)

    if is_long(w):
        square = [*columns, *[ir.Constant(_STRIP, None)] * (LANES - len(columns))]
        parts = [(place(row, 0), x) for row, x in enumerate(transposed(builder, square))]
    else:
        parts = [(place(0, column), x) for column, x in enumerate(columns)]
    add = context.get_function(operator.add, signature(number, number, number))
    for at, x in parts:
        if is_long(w):
            at = builder.bitcast(at, _STRIP.as_pointer())
            builder.store(builder.fadd(builder.load(at, align=8), x) if added else x, at, align=8)
        else:
            x = add(builder, [load_number(context, builder, number, at), x]) if added else x
            store_number(context, builder, number, x, at)
    return context.get_dummy_value()


@lower_builtin(put_across, BundleType, TableType, types.Integer, types.BaseTuple)
def _lower_put_across(context, builder, sig, args):
    return _across(context, builder, sig, args, False)


@lower_builtin(add_across, BundleType, TableType, types.Integer, types.BaseTuple)
def _lower_add_across(context, builder, sig, args):
    return _across(context, builder, sig, args, True)


@infer_global(with_seventh)
class _WithSeventh(AbstractTemplate):
    def generic(self, args, kws):
        w, x, _ = args
        if isinstance(w, BundleType) and is_long(w) and x == LANE:
            return signature(LANE, w, LANE, types.float64)


@lower_builtin(with_seventh, BundleType, types.Any, types.Float)
def _lower_with_seventh(context, builder, sig, args):
    return builder.insert_element(args[1], args[2], _PLACE(6))
