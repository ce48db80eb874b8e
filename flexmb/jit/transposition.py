"""Conversion of the rows of eight copies to lanes and back: transposition of squares of eight by eight numbers.

Conversion number by number needs a load, a store and an address for each, which for small mechanisms is a tenth of the
time of an evaluation. A square takes eight loads, 24 shuffles and eight stores.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import lower_builtin

from flexmb.jit.lanes import BYTES, LANES
from flexmb.jit.tables import TableType

_NUMBERS = ir.VectorType(ir.DoubleType(), LANES)
_PLACES = ir.VectorType(ir.IntType(32), LANES)
_FLOAT = 8  # bytes, also the alignment of rows


def square_to_lanes(rows: Any, first: Any, i: Any, lanes: Any) -> None:
    """Write numbers i .. i + LANES - 1 of LANES rows (copies,n), from copy `first` on, to lanes (n,LANES)."""
    lanes[i : i + LANES] = rows[first : first + LANES, i : i + LANES].T


def square_to_rows(rows: Any, first: Any, i: Any, lanes: Any) -> None:
    """Write the same numbers of the lanes to the rows."""
    rows[first : first + LANES, i : i + LANES] = lanes[i : i + LANES].T


@infer_global(square_to_lanes)
@infer_global(square_to_rows)
class _Square(AbstractTemplate):
    def generic(self, args, kws):
        rows, first, i, lanes = args
        is_rows = isinstance(rows, types.Array) and (rows.dtype, rows.ndim, rows.layout) == (types.float64, 2, "C")
        if is_rows and isinstance(lanes, TableType) and (lanes.dtype, lanes.ndim) == (types.float64, 2):
            return signature(types.none, rows, types.intp, types.intp, lanes)


@lower_builtin(square_to_lanes, types.Array, types.Integer, types.Integer, TableType)
def _to_lanes(context, builder, sig, args):
    rows, lanes = _places(context, builder, sig, args)
    values = transposed(builder, [builder.load(row, align=_FLOAT) for row in rows])
    for value, place in zip(values, lanes, strict=True):
        builder.store(value, place, align=BYTES)
    return context.get_dummy_value()


@lower_builtin(square_to_rows, types.Array, types.Integer, types.Integer, TableType)
def _to_rows(context, builder, sig, args):
    rows, lanes = _places(context, builder, sig, args)
    values = transposed(builder, [builder.load(place, align=BYTES) for place in lanes])
    for value, row in zip(values, rows, strict=True):
        builder.store(value, row, align=_FLOAT)
    return context.get_dummy_value()


def _places(context: Any, builder: Any, sig: Any, args: Any) -> tuple[list[Any], list[Any]]:
    """Addresses of the rows of a square, and of its lanes."""
    rows, first, i, lanes = args
    array = context.make_array(sig.args[0])(context, builder, rows)
    length = builder.extract_value(array.shape, 1)
    bytes_of_rows = builder.bitcast(array.data, ir.IntType(8).as_pointer())

    def at(base: Any, number: Any) -> Any:
        place = builder.gep(base, [builder.mul(number, number.type(_FLOAT))], inbounds=True)
        return builder.bitcast(place, _NUMBERS.as_pointer())

    def of_row(copy: int) -> Any:
        return builder.add(builder.mul(builder.add(first, first.type(copy)), length), i)

    def of_lanes(number: int) -> Any:
        return builder.mul(builder.add(i, i.type(number)), i.type(LANES))

    base = builder.extract_value(lanes, 0)
    return [at(bytes_of_rows, of_row(k)) for k in range(LANES)], [at(base, of_lanes(k)) for k in range(LANES)]


def transposed(builder: Any, square: list[Any]) -> list[Any]:
    """The transposed square: blocks of half, a quarter and an eighth of its size are exchanged across the diagonal."""
    rows, distance = list(square), LANES // 2
    while distance:
        for upper in (k for k in range(LANES) if not k & distance):
            a, b = rows[upper], rows[upper + distance]
            left = [j if not j & distance else LANES + j - distance for j in range(LANES)]
            right = [j + distance if not j & distance else LANES + j for j in range(LANES)]
            rows[upper], rows[upper + distance] = (
                builder.shuffle_vector(a, b, ir.Constant(_PLACES, places)) for places in (left, right)
            )
        distance //= 2
    return rows
