"""Entry points for eight copies at once: accelerations of many states, and the right-hand side of runs in lanes."""

from __future__ import annotations

from typing import NamedTuple

from flexmb.entry import articulated
from flexmb.integrate.control import all_finite
from flexmb.jit.kernel import by_bundle, helper, kernel
from flexmb.jit.lanes import LANES
from flexmb.motion import coordinates
from flexmb.spatial.vector import mat3, store3, store9, vec3
from flexmb.tables.lane_tables import LaneConstants
from flexmb.tables.status import NONFINITE, OK
from flexmb.typing import Index, Real

DOUBTFUL = -1  # a status: among the copies of a block one met a pivot that may be rounding


class Copies(NamedTuple):
    """n states, what is found of them, and a status for each: OK, why not, or DOUBTFUL."""

    q: Real  # (n,nq)
    u: Real  # (n,nu)
    t: Real  # (n,) s
    accelerations: Real  # (n,nu)
    status: Index  # (n,)


@helper
def _shared_places(c, w):
    """Constants that all copies share: the workspace was made with them."""


@helper
def _own_places(c, w):
    """What a workspace holds of the constants, of copies with constants of their own."""
    store3(w.ground, 0, vec3(c.ground, 0))
    for i in range(c.rest.shape[0]):
        store3(w.port[i].r, 0, vec3(c.rest[i].r, 0))
        store9(w.port[i].R, 0, mat3(c.rest[i].R, 0))


take_places = by_bundle(LaneConstants, _own_places, _shared_places)


@kernel
def rhs(stage, s, c, w):
    """Slopes s.k[stage] (n,) of the states s.trial (n,) at the times s.time; returns a status code of all copies."""
    return articulated.rhs(s.time[0], s.trial, s.k[stage], c, w)


@kernel
def accelerations(start, stop, copies, problem, entries, doubt):
    """udot of copies start to stop - 1, LANES at a time; what is left over has the last one in its empty lanes.

    By the right-hand side of runs, so that there is one kernel for both. doubt (1,) is that of the workspace.
    """
    nq, nu = copies.q.shape[1], copies.u.shape[1]
    for first in range(start, stop, LANES):
        for lane in range(LANES):
            copy = min(first + lane, stop - 1)
            entries.time[0, lane] = copies.t[copy]
            for i in range(nq):
                entries.trial[i, lane] = copies.q[copy, i]
            for j in range(nu):
                entries.trial[nq + j, lane] = copies.u[copy, j]
        status = problem.rhs(0, problem.stages, problem.constants, problem.workspace)
        for lane in range(min(LANES, stop - first)):
            found = copies.accelerations[first + lane]
            for j in range(nu):
                found[j] = entries.k[0, nq + j, lane]
            if status != OK or not all_finite(found):
                copies.status[first + lane] = NONFINITE if status == OK else status
            else:
                copies.status[first + lane] = DOUBTFUL if doubt[0] != 0 else OK


@kernel
def project(s, c):
    """Put the states s.trial (n,) back on the manifold at the times s.time."""
    coordinates.project(s.time[0], s.trial, c)


@kernel
def begin(c, w):
    """Make a workspace ready for runs with these constants."""
    take_places(c, w)
