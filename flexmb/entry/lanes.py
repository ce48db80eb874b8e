"""Entry points for eight copies at once: accelerations of many states, and the right-hand side of runs in lanes."""

from __future__ import annotations

import numpy as np

from flexmb.entry import articulated
from flexmb.integrate.lane_problem import lane_entries, lane_stages
from flexmb.jit.direct import at_address, nothing_at, status_at
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES
from flexmb.motion import coordinates
from flexmb.spatial.vector import mat3, store3, store9, vec3
from flexmb.tables.status import NONFINITE, OK

DOUBTFUL = -1  # a status: among the copies of a block one met a pivot that may be rounding


@kernel
def rhs(s, c, w):
    """Slopes (n,) of the states s.trial (n,) at the times s.time; returns a status code of all copies."""
    return articulated.rhs(s.time[0], s.trial, s.k[s.stage[0]], c, w)


entries_at = at_address(lane_entries(lane_stages(1), np.zeros(1, np.int64)))


@kernel
def accelerations(where, blocks, span, q, u, t, found, status):
    """udot (n,nu) of copies span[0] to span[1] - 1 at q (n,nq), u (n,nu), t (n,), and a status (n,) for each.

    `where`: addresses of `rhs` and `begin`, of stages, workspace and entries; `blocks`: of the constants of each LANES
    copies, or of those that all share. Where fewer copies are left, the last one is in the empty lanes too. By the
    right-hand side of runs: there is one kernel for both.
    """
    function, beginning, s, w, e = where
    start, stop = span
    c = blocks[0]
    entries = entries_at(e)
    nq, nu = q.shape[1], u.shape[1]
    for first in range(start, stop, LANES):
        _gather(first, stop, q, entries.trial)
        _gather(first, stop, u, entries.trial[nq:])
        for lane in range(LANES):
            entries.time[0, lane] = t[min(first + lane, stop - 1)]
        if blocks.shape[0] > 1:
            c = blocks[first // LANES]
            nothing_at(beginning, (c, w))
        whole = status_at(function, (s, c, w))
        slope, trouble = entries.k[0, nq : nq + nu], entries.norm[0]
        for lane in range(LANES):
            trouble[lane] = 0.0
        for j in range(nu):
            for lane in range(LANES):
                trouble[lane] += slope[j, lane] - slope[j, lane]  # NaN unless it is finite
        for lane in range(min(LANES, stop - first)):
            for j in range(nu):
                found[first + lane, j] = slope[j, lane]
            if whole != OK:
                status[first + lane] = whole
            elif trouble[lane] != 0.0:
                status[first + lane] = NONFINITE
            else:
                status[first + lane] = DOUBTFUL if entries.doubt[0] != 0 else OK


@helper
def _gather(first, stop, rows, lanes):
    """lanes (n,LANES) = the rows (copies,n) from `first` on; where there are no more, the last one before `stop`."""
    for i in range(rows.shape[1]):
        if first + LANES <= stop:
            for lane in range(LANES):
                lanes[i, lane] = rows[first + lane, i]
        else:
            for lane in range(LANES):
                lanes[i, lane] = rows[min(first + lane, stop - 1), i]


@kernel
def project(s, c):
    """Put the states s.trial (n,) back on the manifold at the times s.time."""
    coordinates.project(s.time[0], s.trial, c)


@kernel
def begin(c, w):
    """What a workspace holds of the constants, of copies with constants of their own: before they are evaluated."""
    w.displaced[0] = 1  # bodies at rest are put there again
    store3(w.ground, 0, vec3(c.ground, 0))
    for i in range(c.rest.shape[0]):
        store3(w.port[i].r, 0, vec3(c.rest[i].r, 0))
        store9(w.port[i].R, 0, mat3(c.rest[i].R, 0))
