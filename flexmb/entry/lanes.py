"""Entry points for eight copies at once: accelerations of many states, and the right-hand side of runs in lanes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from flexmb.entry import articulated
from flexmb.integrate.lane_problem import LaneEntries, LaneStages, lane_entries, lane_stages, mark_finite, set_all
from flexmb.jit.bundle import bundle
from flexmb.jit.direct import at_address, nothing_at, status_at
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES
from flexmb.jit.transposition import square_to_lanes, square_to_rows
from flexmb.motion import coordinates
from flexmb.spatial.vector import mat3, store3, store9, vec3
from flexmb.tables.status import NONFINITE, OK
from flexmb.typing import Index

DOUBTFUL = -1  # a status: a copy of the block met a pivot that may consist of rounding errors


@kernel
def rhs(s, c, w):
    """dy/dt (n,) of the states s.trial (n,) at the times s.time; returns one status code for all copies."""
    return articulated.slope(s.time[0], s.trial, s.k[s.stage[0]], c, w)


@bundle
class LaneGate:
    """The arrays and addresses with which one thread evaluates accelerations.

    `blocks`: addresses of the constants of each block of LANES copies, or of the constants that all copies share.
    """

    stages: LaneStages
    entries: LaneEntries  # the same memory as `stages`, as arrays of single numbers
    calls: Index  # (4,) addresses: `rhs`, `begin` or 0 where all copies share their constants; stages, workspace
    blocks: Index  # (blocks of copies,) or (1,)


def lane_gate(stages: LaneStages, entries: LaneEntries, calls: Sequence[int], blocks: Sequence[int]) -> LaneGate:
    """A gate of arrays to which the caller holds references."""
    return LaneGate(stages, entries, np.array(calls, np.int64), np.array(blocks, np.int64))


def _an_example() -> LaneGate:
    stages = lane_stages(1)
    return lane_gate(stages, lane_entries(stages, np.zeros(1, np.int64)), (), ())


gate_at = at_address(_an_example())


@kernel
def accelerations(gate, start, stop, q, u, t, found, status):
    """udot (n,nu) of copies `start` to stop - 1 at q (n,nq), u (n,nu), t (n,) or (1,), and a status (n,) for each.

    `gate` is the address of a `LaneGate`. Returns the number of copies whose status is not OK. The last copy also fills
    the unused lanes of the last block. Evaluated by the right-hand side of runs, so that one kernel serves both.
    """
    g = gate_at(gate)
    rhs, begin, stages, w = g.calls[0], g.calls[1], g.calls[2], g.calls[3]
    s, entries, c = g.stages, g.entries, g.blocks[0]
    nq, nu, missing = q.shape[1], u.shape[1], 0
    s.stage[0] = 0
    if t.shape[0] == 1:
        set_all(entries.time, t[0])
    for first in range(start, stop, LANES):
        copies = min(LANES, stop - first)
        _gather(first, copies, q, entries.trial)
        _gather(first, copies, u, entries.trial[nq:])
        if t.shape[0] > 1:
            for lane in range(LANES):
                entries.time[0, lane] = t[first + min(lane, copies - 1)]
        if begin != 0:
            c = g.blocks[first // LANES]
            nothing_at(begin, (c, w))
        whole = status_at(rhs, (stages, c, w))
        if whole == OK and entries.doubt[0] != 0:
            whole = DOUBTFUL
        mark_finite(s.k[0, nq : nq + nu], s.chosen)
        _scatter(first, copies, entries.k[0, nq : nq + nu], found)
        for lane in range(copies):
            sound = entries.chosen[0, lane] == 1.0 and math.isfinite(entries.time[0, lane])
            status[first + lane] = whole if whole > OK or sound else NONFINITE
            if status[first + lane] != OK:
                missing += 1
    return missing


@helper
def _gather(first, copies, rows, lanes):
    """lanes (n,LANES) = `copies` rows (n,) from `first` on; the last row also fills the lanes beyond."""
    n = rows.shape[1]
    if copies == LANES and n >= LANES:
        for i in range(0, n, LANES):
            square_to_lanes(rows, first, min(i, n - LANES), lanes)  # the last square overlaps the one before
    else:
        for i in range(n):
            for lane in range(LANES):
                lanes[i, lane] = rows[first + min(lane, copies - 1), i]


@helper
def _scatter(first, copies, lanes, rows):
    """`copies` rows from `first` on = lanes (n,LANES)."""
    n = rows.shape[1]
    if copies == LANES and n >= LANES:
        for i in range(0, n, LANES):
            square_to_rows(rows, first, min(i, n - LANES), lanes)
    else:
        for i in range(n):
            for lane in range(copies):
                rows[first + lane, i] = lanes[i, lane]


@kernel
def project(s, c):
    """Project the states s.trial (n,) to the configuration manifold at the times s.time."""
    coordinates.put_back(s.time[0], s.trial, c)


@kernel
def begin(c, w):
    """Set the parts of a workspace that are copies of constants, before a block with its own constants is evaluated."""
    w.displaced[0] = 1  # the next sweep computes the ports of undeformed bodies again
    store3(w.ground, 0, vec3(c.ground, 0))
    for i in range(c.rest.shape[0]):
        store3(w.port[i].r, 0, vec3(c.rest[i].r, 0))
        store9(w.port[i].R, 0, mat3(c.rest[i].R, 0))
