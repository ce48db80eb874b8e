"""The tables of a scene whose numbers are duals: each lane holds the derivatives of all constants by one parameter.

Kernels that are compiled for them and for the workspace of `flexmb.entry.tangent` carry derivatives along the state and
by the parameters at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from flexmb.closure.tables import ClosureConstants
from flexmb.jit.bundle import broaden, bundle
from flexmb.jit.duals import DUAL, RATES
from flexmb.jit.wide_arrays import as_duals
from flexmb.levels.affine_integrals import moving_columns
from flexmb.tables.arrays import Constants
from flexmb.typing import Flags, Index, Real

# What is no function of the numbers that motions depend on: thresholds for rounding, weights that compare rows, which
# modes move masses along an axis. Their derivatives are zero.
_STEADY = {"moves", "doubtful", "weight", "length"}
# Integers that say that a matrix is diagonal. Where it is not for other numbers, kernels use all of its elements.
_DIAGONAL = {"orthogonal", "uncoupled"}
# What workspaces have copies of, and what follows from derivatives along all directions.
_COPIED = {"gravity", "port", "product", "moves"}


@bundle
class DualConstants(Constants):
    """The constants of a tree, and their derivatives by RATES parameters."""

    numbers = DUAL


@bundle
class DualClosureConstants(ClosureConstants):
    """The constants of closures, and their derivatives by RATES parameters."""

    numbers = DUAL


class Tables(NamedTuple):
    """All tables of a scene, and y (nq+nu+1,) = [q, u, work] of its initial state."""

    tree: Constants
    closures: ClosureConstants | None
    start: Real


class ParameterBlock(NamedTuple):
    """Parameters `names` (k,), at most RATES of them, in the lanes of the constants, in this order."""

    names: tuple[str, ...]
    constants: DualConstants
    closures: DualClosureConstants | None


class TableFloats(NamedTuple):
    """Floats of a table, or of one field of its records."""

    table: str
    field: str | None
    values: Real


def columns(tables: Tables) -> Iterator[TableFloats]:
    """All floats that depend on the numbers of a scene, in a fixed order."""
    for kind, table in (("tree", tables.tree), ("closures", tables.closures)):
        for each in () if table is None else fields(table):
            array = getattr(table, each.name)
            for field in _fields_of(array.dtype, np.float64):
                if (field or each.name) not in _STEADY:
                    yield TableFloats(f"{kind}.{each.name}", field, array if field is None else array[field])
    yield TableFloats("start", None, tables.start)


@cache
def _fields_of(dtype: np.dtype, number: type) -> tuple[str | None, ...]:
    """The fields of records that hold such numbers; None of an array that has no records but these."""
    if dtype.names is None:
        return (None,) if dtype == number else ()
    return tuple(name for name in dtype.names if dtype[name].base == number)


def numbers_of(tables: Tables) -> Real:
    """(n,) all of these floats in a row."""
    return np.concatenate([column.values.ravel() for column in columns(tables)])


def parts(tables: Tables, coordinates: int) -> list[slice | Index]:
    """The columns in that row; coordinates and speeds of the initial state apart.

    Without the second-order fields of masses that stand for others: see `moments`.
    """
    found, start = list[slice | Index](), 0
    summed = np.concatenate([np.zeros(0, np.intp), *(rows for _, rows in _summed(tables.tree))])
    for column in columns(tables):
        size = column.values.size
        if column.table == "tree.second_shape":
            places = np.arange(start, start + size).reshape(column.values.shape)
            found.append(np.delete(places, summed, axis=0).ravel())
            start += size
            continue
        sizes = [size] if column.table != "start" else [coordinates, size - coordinates]
        for each in sizes:
            found.append(slice(start, start + each))
            start += each
    return found


def wholes(tables: Tables) -> Real:
    """(n,) of each float in that row the size of the largest in its table; zero of the initial state, whose coordinates
    and speeds are no parts of one."""
    each, size = list(columns(tables)), dict[str, float]()
    for column in each:
        own = float(np.max(np.abs(column.values), initial=0.0)) if column.table != "start" else 0.0
        size[column.table] = max(size.get(column.table, 0.0), own)
    return np.repeat([size[column.table] for column in each], [column.values.size for column in each])


def moments(tables: Tables, weights: Tables) -> list[Real]:
    """By body, the integrals (k,) sum m a G of the second-order field G of point masses with a = 1, position and mode
    shapes in the tables `weights`.

    Mode shapes of two planes may be equal to nine digits. The direction of their difference, along which one of the
    masses that stand for all others moves (`flexmb.modal.equivalent`), then has seven digits, and so has G there. What
    motions depend on are these integrals, which have all digits but for sum m G G, whose part there is arbitrary.
    """
    moments = []
    modes = weights.tree.point_mode[:, 3:]
    for points, rows in _summed(weights.tree):
        of = weights.tree.point[points]
        one = np.column_stack([np.ones(len(of)), of["position"], modes[points].reshape(len(of), -1)])
        moments.append(np.tensordot(one * of["mass"][:, None], tables.tree.second_shape["translation"][rows], (0, 0)))
    return [array.ravel() for array in moments]


def _summed(tree: Constants) -> list[tuple[Index, Index]]:
    """By body, its point masses with a second-order field that do not turn, and the rows of these fields."""
    point, found = tree.point, list[tuple[Index, Index]]()
    for body in tree.body:
        own = np.arange(body["point_start"], body["point_stop"])
        own = own[(point["second"][own] >= 0) & (point["mass"][own] > 0.0) & (point["turning"][own] == 0)]
        if len(own):
            found.append((own, point["second"][own]))
    return found


def structure(tables: Tables) -> dict[str, Any]:
    """Everything else that the kernels depend on: the shapes of the tables, and their integers."""
    arrays = dict[str, Any]()
    for kind, table in (("tree", tables.tree), ("closures", tables.closures)):
        for each in () if table is None else fields(table):
            array = getattr(table, each.name)
            arrays[f"{kind}.{each.name}"] = array.shape
            for field in _fields_of(array.dtype, np.int64):
                if field is not None and field not in _DIAGONAL:
                    arrays[f"{kind}.{each.name}.{field}"] = array[field].tobytes()
    return arrays


def diagonal(tables: Tables) -> Real:
    """Which matrices of the bodies are diagonal, (fields, N)."""
    return np.array([tables.tree.body[field] for field in sorted(_DIAGONAL)])


def blocks(tables: Tables, is_diagonal: Real, names: Sequence[str], rates: Real) -> tuple[ParameterBlock, ...]:
    """Dual tables for the derivatives (n,P) of `numbers_of` by all parameters.

    is_diagonal: `diagonal`, of the scene and of those with other numbers.
    """
    body = tables.tree.body.copy()
    for field, values in zip(sorted(_DIAGONAL), is_diagonal, strict=True):
        body[field] = values
    tree = replace(tables.tree, body=body)
    blocks = [
        _block(tables._replace(tree=tree), tuple(names[first : first + RATES]), rates[:, first : first + RATES])
        for first in range(0, len(names), RATES)
    ]
    broaden([dual.constants for dual in blocks])
    if tables.closures is not None:
        broaden([dual.closures for dual in blocks])
    return tuple(blocks)


def _block(tables: Tables, names: tuple[str, ...], rates: Real) -> ParameterBlock:
    """Dual tables for the derivatives (n,k) by k parameters."""
    duals = {kind: _duals(table) for kind, table in (("tree", tables.tree), ("closures", tables.closures))}
    for column, own in _with_rates(tables, rates, np.any(rates, axis=1)):
        kind, _, table = column.table.partition(".")
        wide = duals[kind][table] if column.field is None else duals[kind][table][column.field]
        wide[..., 1 : 1 + rates.shape[1]] = own
    tree = duals["tree"]
    moving = moving_columns(np.max(np.abs(tree["product"]), axis=-1))
    tree["moves"][..., 0] = np.maximum(tree["moves"][..., 0], moving)
    closures = None if tables.closures is None else DualClosureConstants(**duals["closures"])
    return ParameterBlock(names, DualConstants(**tree), closures)


def put(block: ParameterBlock, before: Tables, now: Tables, is_diagonal: Real, rates: Real, moving: Flags) -> bool:
    """Put other numbers of a tree into its dual tables in place: those of `now` for those of `before`, which have the
    same structure, and their derivatives (n,k). moving (n,): which of them have derivatives, before or now.

    False where this does not do: what workspaces have copies of must stay, and the features of the kernels suffice.
    """
    old, new, wide = before.tree, now.tree, block.constants
    changed = [field.name for field in fields(new)
               if getattr(new, field.name).tobytes() != getattr(old, field.name).tobytes()]  # fmt: skip
    lanes = [(column.table.removeprefix("tree."), column.field, each)
             for column, each in _with_rates(now, rates, moving)]  # fmt: skip
    own = slice(1, 1 + rates.shape[1])
    if not (
        now.closures is None
        and _COPIED.isdisjoint(changed)
        and all(np.array_equal(_of(wide, name, field)[..., own], rate)
                for name, field, rate in lanes if name in _COPIED)
        and all(np.array_equal(wide.body[field], flags)
                for field, flags in zip(sorted(_DIAGONAL), is_diagonal, strict=True))
    ):  # fmt: skip
        return False
    for each in fields(new):
        getattr(wide, each.name).setflags(write=True)
    for name in changed:
        for field in getattr(new, name).dtype.names or (None,):
            if _of(new, name, field).dtype == np.float64:
                _of(wide, name, field)[..., 0] = _of(new, name, field)
    for name, field, each in lanes:
        _of(wide, name, field)[..., own] = each
    for each in fields(new):
        getattr(wide, each.name).setflags(write=False)
    return wide.features() <= wide._numba_type_.features


def _of(table: Constants, name: str, field: str | None) -> Any:
    """An array of a table, or a field of its records."""
    array = getattr(table, name)
    return array if field is None else array[field]


def _with_rates(tables: Tables, rates: Real, moving: Flags) -> Iterator[tuple[TableFloats, Real]]:
    """Those `columns` but the initial state in which some entries are `moving` (n,), with their part (...,k) of
    derivatives (n,k) of `numbers_of` the tables."""
    start = 0
    for column in columns(tables):
        stop = start + column.values.size
        if column.table != "start" and np.any(moving[start:stop]):
            yield column, rates[start:stop].reshape(*column.values.shape, rates.shape[1])
        start = stop


def _duals(table: Constants | ClosureConstants | None) -> dict[str, Any]:
    return {} if table is None else {field.name: as_duals(getattr(table, field.name)) for field in fields(table)}
