"""Which closures feel each other's loads, and which speeds these may change.

Loads act on a tree by the accelerations that they cause. With M = F F', those of a closure are F'^-1 x of an x that is
zero but for the speeds of bodies between its ports and the ground, so that J M^-1 J' of two closures vanishes unless a
body on both paths has a speed that is free. Hence loops that hang from the ground side by side, or from a base that is
welded or driven, cost as much as each by itself: their sum, not the cube of their number.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.closure import tables as t
from flexmb.tables.arrays import Constants
from flexmb.typing import Index, Record


def groups(c: Constants, paths: Sequence[Sequence[int]]) -> list[list[int]]:
    """Closures by group, from the bodies that loads on each pass; groups in the order of their first closure."""
    first = {}  # closure that passed a body first
    leader = list(range(len(paths)))

    def leader_of(i: int) -> int:
        while leader[i] != i:
            leader[i] = i = leader[leader[i]]
        return i

    moves = _moves(c)
    for i, path in enumerate(paths):
        for k in path:
            if moves[k]:
                one, other = sorted((leader_of(first.setdefault(k, i)), leader_of(i)))
                leader[other] = one
    found: dict[int, list[int]] = {}
    for i in range(len(paths)):
        found.setdefault(leader_of(i), []).append(i)
    return list(found.values())


def group_tables(
    c: Constants, members: Sequence[Sequence[int]], paths: Sequence[Sequence[int]], rows: Sequence[int]
) -> tuple[Record, Index]:
    """GROUP records of closures by group, and the columns of all; `rows`: how many each closure has."""
    out, columns = np.zeros(len(members), t.GROUP), list[int]()
    row = half = factor = 0
    for group, closures in zip(out, members, strict=True):
        own = _speeds(c, sorted({k for i in closures for k in paths[i]}))
        count = sum(rows[i] for i in closures)
        group["row_start"], group["column_start"], group["half"], group["factor"] = row, len(columns), half, factor
        columns += own
        row, half, factor = row + count, half + count * len(own), factor + count * count
        group["row_stop"], group["column_stop"] = row, len(columns)
    return out, np.array(columns, np.int64)


def _moves(c: Constants) -> list[bool]:
    """Whether loads on each body change a speed of its own: a hinge's that is free, or a mode's."""
    free = np.append(0, np.cumsum(c.speed["prescribed"] < 0))
    first = c.body["u_index"]
    found: list[bool] = ((free[first + c.body["nv"]] > free[first]) | (c.body["modes"] > 0)).tolist()
    return found


def _speeds(c: Constants, bodies: Sequence[int]) -> list[int]:
    """All speeds of these bodies: of hinge, modes and wheels."""
    found = list[int]()
    for body in c.body[list(bodies)]:
        for first, count in (("u_index", "nv"), ("etad_index", "modes")):
            found += range(body[first], body[first] + body[count])
        found += c.wheel["u_index"][body["wheel_start"] : body["wheel_stop"]].tolist()
    return found
