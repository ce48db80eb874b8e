"""Prefetching of records of a table, for sweeps over more bodies than fit into the processor's caches."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, type_callable

from flexmb.jit.tables import BYTE, TableType

_LINE, _LINES = 64, 8  # bytes of a cache line, and number of lines of a record that every sweep uses


def prefetch(table: Any, i: Any) -> None:
    """For kernels: row i will soon be read and written. The row need not exist."""


@type_callable(prefetch)
def _type_of_nothing(context):
    return lambda table, i: types.none if isinstance(table, TableType) else None


@lower_builtin(prefetch, TableType, types.Integer)
def _prefetch(context, builder, sig, args):
    word = ir.IntType(32)
    function = cgutils.get_or_insert_function(
        builder.module, ir.FunctionType(ir.VoidType(), [BYTE.as_pointer(), word, word, word]), "llvm.prefetch.p0"
    )
    i = context.cast(builder, args[1], sig.args[1], types.int64)
    row = builder.gep(builder.extract_value(args[0], 0), [builder.mul(i, i.type(sig.args[0].dtype.size))])
    for n in range(_LINES):
        builder.call(function, [builder.gep(row, [i.type(n * _LINE)]), word(1), word(3), word(1)])
    return context.get_dummy_value()
