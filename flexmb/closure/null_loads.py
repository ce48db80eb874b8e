"""Responses of the groups of rows to unit loads, and the loads of the rows that cause no acceleration."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flexmb.closure.tables import ClosureConstants, ClosureWorkspace
from flexmb.typing import Index, Real


class GroupResponse(NamedTuple):
    """One group: its rows; its columns (indices of speeds, the first `own` are not shared); B' (rows,columns)."""

    rows: slice
    columns: Index
    half: Real
    own: int


def blocks(cc: ClosureConstants, cw: ClosureWorkspace) -> Iterator[GroupResponse]:
    """B' of every group."""
    for group in cc.group:
        rows = slice(int(group["row_start"]), int(group["row_stop"]))
        columns = cc.column[group["column_start"] : group["column_stop"]]
        shape = rows.stop - rows.start, len(columns)
        half = cw.half[group["half"] : group["half"] + shape[0] * shape[1]].reshape(shape)
        yield GroupResponse(rows, columns, half, int(group["own_stop"] - group["column_start"]))


def null_loads(cc: ClosureConstants, cw: ClosureWorkspace) -> list[tuple[slice, Real]]:
    """Slice of the rows and orthonormal null loads (rows,k), for each group that has null loads."""
    loads: list[tuple[slice, Real]] = []
    if np.array_equal(cw.rank, cc.group["row_stop"] - cc.group["row_start"]):
        return loads
    for (rows, _, whole, own), rank in zip(blocks(cc, cw), cw.rank.tolist(), strict=True):
        half = whole[:, :own]
        if rank < len(half):
            order = cw.chosen[rows] - rows.start
            chosen, rest = order[:rank], order[rank:]
            null = np.zeros((len(half), len(rest)))
            null[rest] = np.eye(len(rest))
            null[chosen] = -np.linalg.lstsq(half[chosen].T, half[rest].T, rcond=None)[0]
            loads.append((rows, np.linalg.qr(null)[0]))
    return loads
