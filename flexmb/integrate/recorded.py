"""The accepted steps of a run: their times, every so many of their states, and the fastest ones, as an integrator finds
them.

An integrator projects the state at the end of every step that it accepts. The problem that it is given here passes all
that it is asked on to another one, and keeps what was projected. Times of samples within steps are kept, too. Of runs
in lanes only the fastest states are kept.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexmb.integrate.lane_problem import LaneEntries, LaneProblem, LaneStages
from flexmb.integrate.problem import Problem, StiffProblem
from flexmb.integrate.watch import Watch
from flexmb.jit.bundle import AnyBundle, bundle
from flexmb.jit.direct import nothing_at, real_at, status_at
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES, some
from flexmb.jit.pointer import REAL, STATUS, VECTOR, VOID, WHOLE, Pointer, pointer
from flexmb.typing import Index, Real

# Indices in `RecordedSteps.address` and, the first four, in that of `flexmb.sensitivity.adjoint.stages.Stages`.
RHS, PROJECT, CONSTANTS, WORKSPACE, BACK, LEAP, MOVE, RESOLVE, LOOK = range(9)
_SHORTEST = 1e-300  # s: a run of no length has one state
ADDRESSES = 4
"""How many of them a problem without leaps, and without Jacobian, has."""


@bundle
class FastestStates:
    """Of R runs, in each of K equal parts of their time, the states at the end of a step or at a sample in which G sums
    of the absolute values of the entries `entry` (m,) of y are largest.

    size (R,G,K): these sums, or `slow` where none was larger; state (R,G,K,1+n): t (s) and the first n numbers of y;
    times (2,): the start (s) of the runs, and how many parts a second has.
    """

    entry: Index
    weight: Real  # (G,m) of the entries in each sum
    slow: Real  # (R,G) the sums of states that are not kept: 1, or inf of what is not watched
    size: Real
    state: Real
    times: Real

    def begin(self, times: Real) -> None:
        """Forget all states, before a run over these times (s)."""
        self.size[:], self.state[:] = self.slow[:, :, None], np.nan
        self.times[:] = times[0], self.size.shape[2] / max(times[-1] - times[0], _SHORTEST)

    def of_run(self, run: int) -> Real:
        """The states (k,1+n) that are kept of a run."""
        found = self.state[run].reshape(-1, self.state.shape[3])
        return found[~np.isnan(found[:, 0])]


@bundle
class RecordedSteps:
    """The steps of one part of a run; `count` goes on where `time` is full.

    A leap over a singular position enters its end twice.
    """

    address: Index  # of the kernels and tables of the motion
    every: Index  # (1,) how many steps lie between two states that are kept
    count: Index  # (1,) of times; the first is that of the start
    time: Real  # (room,) s
    state: Real  # (rooms,n) at every `every`-th time
    fastest: FastestStates


@helper
def _place_if_larger(t, total, f, run, which):
    """The place for a state of a run with such a sum; -1 if it is not the largest of its part of time."""
    if not total > f.slow[run, which]:
        return -1
    part = (t - f.times[0]) * f.times[1]
    place = min(int(part), f.size.shape[2] - 1) if part > 0.0 else 0
    if not total > f.size[run, which, place]:
        return -1
    f.size[run, which, place] = total
    return place


@helper
def _keep_if_fast(t, y, f):
    """Keep a state in place of the one that is kept of its part of time, if a sum is larger."""
    for g in range(f.weight.shape[0]):
        total = 0.0
        for i in range(f.entry.shape[0]):
            total += f.weight[g, i] * abs(y[f.entry[i]])
        place = _place_if_larger(t, total, f, 0, g)
        if place >= 0:
            f.state[0, g, place, 0] = t
            for i in range(1, f.state.shape[3]):
                f.state[0, g, place, i] = y[i - 1]


@helper
def _enter(t, s):
    """Keep a time; returns its place, or a number beyond the room.

    A step whose end could not be evaluated is repeated with a smaller size: later times are then no ends of steps.
    """
    room, n = s.time.shape[0], s.count[0]
    while 0 < n <= room and t <= s.time[n - 1]:
        n -= 1
    if n < room:
        s.time[n] = t
    s.count[0] = n + 1
    return n


@kernel
def rhs(t, y, dy, s, same):
    """dy/dt of the motion; returns a status code. The record is passed for both arguments."""
    return status_at(s.address[RHS], (t, y, dy, s.address[CONSTANTS], s.address[WORKSPACE]))


@kernel
def project(t, y, s):
    """Project y, and keep it as the end of a step."""
    nothing_at(s.address[PROJECT], (t, y, s.address[CONSTANTS]))
    n = _enter(t, s)
    if n < s.time.shape[0] and n % s.every[0] == 0:
        for i in range(s.state.shape[1]):
            s.state[n // s.every[0], i] = y[i]
    if s.fastest.entry.shape[0] > 0:
        _keep_if_fast(t, y, s.fastest)


@kernel
def back(y, s):
    """See `Problem`."""
    return real_at(s.address[BACK], (y, s.address[CONSTANTS]))


@kernel
def leap(end, y, dy, y_new, dy_new, s):
    """See `Problem`; the end of a leap is entered twice."""
    t = real_at(s.address[BACK], (y_new, s.address[CONSTANTS]))
    h = real_at(s.address[LEAP], (end, y, dy, y_new, dy_new, s.address[CONSTANTS]))
    if h > 0.0:
        _enter(t, s)
        n = _enter(t + h, s)
        if n + 1 < s.time.shape[0]:
            s.time[n + 1] = t + h
        s.count[0] += 1
    return h


@kernel
def move(y, increment, result, s):
    """See `StiffProblem`."""
    nothing_at(s.address[MOVE], (y, increment, result, s.address[CONSTANTS]))


@kernel
def resolve(y, u, x, how, s):
    """See `StiffProblem`."""
    nothing_at(s.address[RESOLVE], (y, u, x, how, s.address[CONSTANTS]))


@kernel
def look(t, y, signal, s):
    """See `flexmb.integrate.watch.Watch`."""
    return status_at(s.address[LOOK], (t, y, signal, s.address[CONSTANTS]))


def watching(record: RecordedSteps, watch: Watch) -> Watch:
    """A watch that sees the signals of the motion by its constants, for the recorded problem, whose constants are the
    record."""
    record.address[LOOK] = watch.look[0]
    return watch.seeing(len(watch.signal), look, record)


def fastest_states(weights: Real, slow: Real, parts: int) -> FastestStates:
    """Room for a state of each of R runs in each of so many parts of time, for G sums; weights (G,n): of the first n
    numbers of y in these, slow (R,G): sums that are too small."""
    entry, size = np.flatnonzero(weights.any(axis=0)), (*slow.shape, parts)
    kept, room = np.ascontiguousarray(weights[:, entry]), np.zeros((*size, 1 + weights.shape[1]))
    return FastestStates(entry, kept, slow, np.zeros(size), room, np.zeros(2))


def nothing_fast() -> FastestStates:
    """Of runs in which nobody looks at speeds."""
    return fastest_states(np.zeros((0, 0)), np.zeros((1, 0)), 0)


def recorded(
    posed: Problem | StiffProblem, room: int, fastest: FastestStates | None = None
) -> tuple[Any, RecordedSteps]:
    """The same problem with a record of its steps, which has room for so many times and no states but the first."""
    kernels = [kernel.__wrapper_address__() for kernel in (posed.rhs, posed.project, posed.back, posed.leap)]
    tables = posed.constants.kernel_address, posed.workspace.kernel_address
    on_group = [posed.move, posed.resolve] if isinstance(posed, StiffProblem) else []
    moving = [kernel.__wrapper_address__() for kernel in on_group]
    address = np.zeros(LOOK + 1, np.int64)
    address[: LEAP + 1 + len(moving)] = *kernels[:2], *tables, *kernels[2:], *moving
    record = RecordedSteps(
        address=address, every=np.array([room + 1]),
        count=np.zeros(1, np.int64), time=np.zeros(room), state=np.zeros((1, 0)),
        fastest=fastest or nothing_fast(),
    )  # fmt: skip
    own = posed._replace(
        rhs=pointer(rhs, STATUS, REAL, VECTOR, VECTOR, record, record),
        project=pointer(project, VOID, REAL, VECTOR, record),
        constants=AnyBundle(record), workspace=AnyBundle(record), back=pointer(back, REAL, VECTOR, record),
        leap=pointer(leap, REAL, REAL, VECTOR, VECTOR, VECTOR, VECTOR, record),
    )  # fmt: skip
    if isinstance(own, StiffProblem):
        own = own._replace(
            move=pointer(move, VOID, VECTOR, VECTOR, VECTOR, record),
            resolve=pointer(resolve, VOID, VECTOR, VECTOR, VECTOR, WHOLE, record),
        )
    return own, record


@bundle
class RecordedLanes:
    """The fastest states of LANES runs at once."""

    address: Index  # (3,) of the kernel that projects, the stages and the constants
    entries: LaneEntries
    fastest: FastestStates


@kernel
def lane_project(s, r):
    """Project s.trial, and keep the states of those lanes that go on from them, or have a sample there."""
    nothing_at(r.address[0], (r.address[1], r.address[2]))
    f, entries = r.fastest, r.entries
    for g in range(f.weight.shape[0]):
        total = 0.0
        for i in range(f.entry.shape[0]):
            total += f.weight[g, i] * abs(s.trial[f.entry[i]])
        if not some(total > 1.0):
            continue
        s.norm[2] = total  # nobody needs it beyond the first step
        for lane in range(LANES):
            if entries.chosen[0, lane] == 1.0:
                place = _place_if_larger(entries.time[0, lane], entries.norm[2, lane], f, lane, g)
                if place >= 0:
                    f.state[lane, g, place, 0] = entries.time[0, lane]
                    for i in range(1, f.state.shape[3]):
                        f.state[lane, g, place, i] = entries.trial[i - 1, lane]


def record_of_lanes(stages: LaneStages, entries: LaneEntries, fastest: FastestStates) -> tuple[RecordedLanes, Pointer]:
    """A record for one thread, of LANES runs after the other, and the kernel that keeps it."""
    record = RecordedLanes(np.zeros(3, np.int64), entries, fastest)
    return record, pointer(lane_project, VOID, stages, record)


def recorded_lanes(posed: LaneProblem, own: tuple[RecordedLanes, Pointer], times: Real) -> LaneProblem:
    """The same problem with its record, which begins anew with all lanes."""
    record, project = own
    tables = posed.stages.kernel_address, posed.manifold.kernel_address
    record.address[:] = posed.project.__wrapper_address__(), *tables
    record.fastest.begin(times)
    record.entries.chosen[:] = 1.0
    return posed._replace(project=project, manifold=AnyBundle(record))
