"""Arrays of bundles in kernels: an address and extents, in C order; a row of records is an address alone.

Numba's own arrays have owners, strides and reference counts, which cost time in every function that they are passed
to, at compilation and in a run. Kernels do not need them: the bundle keeps its arrays, and they are contiguous. In a
kernel a table is used like an array (`c.body[k].parent`, `w.pff[k, n, i] = x`, `U[m, m + 1 : n]`, `a.shape[0]`); a
nested array of a record is a table with constant extents. Indices are not checked, and negative ones do not count from
the end. The floats of a record whose last field is one of PADDING are lanes, duals or complex numbers, as the name of
that field says: see `flexmb.jit.wide_arrays`.
"""

from __future__ import annotations

import operator
from functools import cache
from hashlib import sha256
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_global, signature
from numba.extending import (
    infer_getattr,
    lower_builtin,
    lower_getattr,
    lower_getattr_generic,
    lower_setattr_generic,
    models,
    register_model,
)

from flexmb.jit import complex_numbers
from flexmb.jit.duals import DUAL
from flexmb.jit.lanes import LANE

WORD, BYTE = ir.IntType(64), ir.IntType(8)
PADDING: dict[types.Type, str] = {LANE: "of_lanes", DUAL: "of_duals", complex_numbers.COMPLEX: "of_complex"}
"""Name of the last field of records whose floats are such numbers. Lanes and duals are equally long."""
_WIDE = {name: number for number, name in PADDING.items()}


@cache
def _short(dtype: types.Type) -> str:
    """A name for symbols; for a record a digest of its description, which is long."""
    return f"r{sha256(str(dtype).encode()).hexdigest()[:12]}" if isinstance(dtype, types.Record) else str(dtype)


class TableType(types.Type):
    """Numbers or records in C order."""

    def __init__(self, dtype: types.Type, ndim: int) -> None:
        self.dtype, self.ndim = dtype, ndim
        super().__init__(name=f"T{ndim}{_short(dtype)}")


class RowType(types.Type):
    """One record of a table."""

    def __init__(self, record: types.Record) -> None:
        self.record = record
        super().__init__(name=f"R{_short(record)}")

    def member(self, name: str) -> tuple[types.Type, tuple[int, ...]]:
        """Type and extents of a field; for a nested array the type of its elements."""
        kind, shape = self.record.fields[name].type, ()
        if isinstance(kind, types.NestedArray):
            kind, shape = kind.dtype, kind.shape
        number = _WIDE.get(next(reversed(self.record.fields)))
        if kind == types.float64 and number is not None:
            kind, shape = number, shape[:-1]
        return kind, shape


@register_model(TableType)
class _TableModel(models.StructModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, [("data", types.voidptr), ("shape", types.UniTuple(types.intp, kind.ndim))])


@register_model(RowType)
class _RowModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, BYTE.as_pointer())


def _indices(index: types.Type) -> tuple[types.Type, ...] | None:
    """Types of the integers of an index, and of the slice that may follow; None for any other index."""
    found = tuple(index) if isinstance(index, types.BaseTuple) else (index,)
    *first, last = found
    whole = all(isinstance(i, types.Integer) for i in first) and isinstance(last, types.Integer | types.SliceType)
    return found if whole else None


def _element(kind: TableType, index: types.Type) -> tuple[types.Type, types.Type] | None:
    """Types of kind[index] and of the index in the form that the lowering takes."""
    found = _indices(index)
    if found is None or len(found) > kind.ndim:
        return None
    if isinstance(found[-1], types.SliceType):
        if found[-1].has_step:
            return None
        plain = types.Tuple((*[types.intp] * (len(found) - 1), types.slice2_type))
        return TableType(kind.dtype, kind.ndim - len(found) + 1), plain
    plain = types.UniTuple(types.intp, len(found)) if isinstance(index, types.BaseTuple) else types.intp
    if len(found) < kind.ndim:
        return TableType(kind.dtype, kind.ndim - len(found)), plain
    return RowType(kind.dtype) if isinstance(kind.dtype, types.Record) else kind.dtype, plain


@infer_global(operator.getitem)
class _GetItem(AbstractTemplate):
    def generic(self, args, kws):
        kind, index = args
        if isinstance(kind, TableType):
            found = _element(kind, index)
            if found is not None:
                element, plain = found
                if isinstance(index, types.SliceType):
                    plain = types.slice2_type
                return signature(element, kind, plain)
        return None


@infer_global(operator.setitem)
class _SetItem(AbstractTemplate):
    def generic(self, args, kws):
        kind, index, _ = args
        if isinstance(kind, TableType):
            found = _element(kind, index)
            if found is not None and found[0] == kind.dtype:
                return signature(types.none, kind, found[1], kind.dtype)
        return None


@infer_getattr
class _TableAttribute(AttributeTemplate):
    key = TableType

    def resolve_shape(self, kind):
        return types.UniTuple(types.intp, kind.ndim)


@infer_getattr
class _RowAttribute(AttributeTemplate):
    key = RowType

    def generic_resolve(self, kind, name):
        if name not in kind.record.fields:
            return None
        found, shape = kind.member(name)
        return TableType(found, len(shape)) if shape else found


@lower_getattr(TableType, "shape")
def _shape(context, builder, kind, value):
    return builder.extract_value(value, 1)


def table(context: Any, builder: Any, kind: TableType, data: Any, shape: list[Any]) -> Any:
    """The value of a table at an address."""
    value = ir.Constant(context.get_value_type(kind), ir.Undefined)
    value = builder.insert_value(value, data, 0)
    for i, extent in enumerate(shape):
        value = builder.insert_value(value, extent, [1, i])
    return value


def _place(builder, kind, value, indices):
    """Address of value[indices], and the remaining extents."""
    shape = cgutils.unpack_tuple(builder, builder.extract_value(value, 1))
    offset = indices[0]
    for i, extent in enumerate(shape[1:], 1):
        offset = builder.mul(offset, extent, flags=["nsw"])
        if i < len(indices):
            offset = builder.add(offset, indices[i], flags=["nsw"])
    size = kind.dtype.size if isinstance(kind.dtype, types.Record) else kind.dtype.bitwidth // 8
    offset = builder.mul(offset, WORD(size), flags=["nsw"])
    return builder.gep(builder.extract_value(value, 0), [offset], inbounds=True), shape[len(indices) :]


@lower_builtin(operator.getitem, TableType, types.Integer)
@lower_builtin(operator.getitem, TableType, types.BaseTuple)
@lower_builtin(operator.getitem, TableType, types.SliceType)
def _getitem(context, builder, sig, args):
    kind, index = sig.args
    types_of = tuple(index) if isinstance(index, types.BaseTuple) else (index,)
    indices = cgutils.unpack_tuple(builder, args[1]) if isinstance(index, types.BaseTuple) else [args[1]]
    if isinstance(types_of[-1], types.SliceType):
        part = context.make_helper(builder, types_of[-1], indices[-1])
        extent = builder.extract_value(args[0], [1, len(indices) - 1])
        stop = builder.select(builder.icmp_signed("<", part.stop, extent), part.stop, extent)
        place, left = _place(builder, kind, args[0], [*indices[:-1], part.start])
        return table(context, builder, sig.return_type, place, [builder.sub(stop, part.start), *left])
    place, left = _place(builder, kind, args[0], indices)
    if left:
        return table(context, builder, sig.return_type, place, left)
    return place if isinstance(kind.dtype, types.Record) else load_number(context, builder, kind.dtype, place)


@lower_builtin(operator.setitem, TableType, types.Any, types.Any)
def _setitem(context, builder, sig, args):
    kind, index, number = sig.args
    indices = cgutils.unpack_tuple(builder, args[1]) if isinstance(index, types.BaseTuple) else [args[1]]
    store_number(context, builder, number, args[2], _place(builder, kind, args[0], indices)[0])
    return context.get_dummy_value()


@lower_getattr_generic(RowType)
def _field(context, builder, kind, value, name):
    place = builder.gep(value, [WORD(kind.record.offset(name))], inbounds=True)
    found, shape = kind.member(name)
    if shape:
        return table(context, builder, TableType(found, len(shape)), place, [WORD(n) for n in shape])
    return load_number(context, builder, found, place)


@lower_setattr_generic(RowType)
def _set_field(context, builder, sig, args, name):
    kind, number = sig.args
    place = builder.gep(args[0], [WORD(kind.record.offset(name))], inbounds=True)
    found, _ = kind.member(name)
    store_number(context, builder, found, context.cast(builder, args[1], number, found), place)


def load_number(context: Any, builder: Any, kind: types.Type, place: Any, align: int | None = None) -> Any:
    """Load a number of this type from an address with alignment `align`, by default that of the type."""
    if kind == DUAL:
        return kind.load(builder, place)
    place = builder.bitcast(place, context.get_data_type(kind).as_pointer())
    return context.unpack_value(builder, kind, place) if align is None else builder.load(place, align=align)


def store_number(
    context: Any, builder: Any, kind: types.Type, value: Any, place: Any, align: int | None = None
) -> None:
    """Store a number of this type at such an address."""
    if kind == DUAL:
        kind.store(builder, value, place)
        return
    place = builder.bitcast(place, context.get_data_type(kind).as_pointer())
    if align is None:
        context.pack_value(builder, kind, value, place)
    else:
        builder.store(value, place, align=align)
