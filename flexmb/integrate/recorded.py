"""The accepted steps of a run: their times, every so many of their states, and the fastest ones, as an integrator finds
them.

An integrator projects the state at the end of every step that it accepts. The problem that it is given here passes all
that it is asked on to another one, and keeps what was projected. Times of samples within steps are kept, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from flexmb.integrate.problem import Problem, StiffProblem
from flexmb.integrate.watch import Watch
from flexmb.jit.bundle import AnyBundle, bundle
from flexmb.jit.direct import nothing_at, real_at, status_at
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.pointer import REAL, STATUS, VECTOR, VOID, WHOLE, pointer
from flexmb.typing import Index, Real

# Indices in `RecordedSteps.address` and, the first four, in that of `flexmb.sensitivity.adjoint.stages.Stages`.
RHS, PROJECT, CONSTANTS, WORKSPACE, BACK, LEAP, MOVE, RESOLVE, LOOK = range(9)
ADDRESSES = 4
"""How many of them a problem without leaps, and without Jacobian, has."""


@bundle
class FastestStates:
    """The states of a run, at ends of steps and at samples, in which the speeds `entry` (m,) of y are largest together.

    size (K,): their sums of absolute values, those of K states that were too slow to be kept at first; state (K,1+n): t
    (s) and the first n numbers of y; least (1,): the place of the smallest.
    """

    entry: Index
    slow: Real  # (1,) the sum of those that are too slow
    size: Real
    state: Real
    least: Index

    def empty(self) -> None:
        """Forget all states."""
        self.size[:], self.state[:], self.least[0] = self.slow[0], np.nan, 0


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
def _keep_if_fast(t, y, f):
    """Keep a state in place of the slowest one that is kept, if it is faster."""
    total = 0.0
    for i in range(f.entry.shape[0]):
        total += abs(y[f.entry[i]])
    least = f.least[0]
    if total > f.size[least]:
        f.size[least], f.state[least, 0] = total, t
        for i in range(1, f.state.shape[1]):
            f.state[least, i] = y[i - 1]
        for place in range(f.size.shape[0]):
            if f.size[place] < f.size[f.least[0]]:
                f.least[0] = place


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


def fastest_states(entries: Sequence[int], slow: float, count: int, numbers: int) -> FastestStates:
    """Room for so many states, of so many first numbers of y each, whose sum of these speeds exceeds `slow`."""
    entry, states = np.array(entries, np.int64), np.full((count, 1 + numbers), np.nan)
    return FastestStates(entry, np.array([slow]), np.full(count, slow), states, np.zeros(1, np.int64))


def nothing_fast() -> FastestStates:
    """Of runs in which nobody looks at speeds."""
    return fastest_states([], np.inf, 0, 0)


def recorded(
    posed: Problem | StiffProblem, room: int, fastest: FastestStates | None = None
) -> tuple[Any, RecordedSteps]:
    """The same problem with a record of its steps, which has room for so many times and no states but the first."""
    kernels = [each.__wrapper_address__() for each in (posed.rhs, posed.project, posed.back, posed.leap)]
    tables = posed.constants.kernel_address, posed.workspace.kernel_address
    on_group = [posed.move, posed.resolve] if isinstance(posed, StiffProblem) else []
    moving = [each.__wrapper_address__() for each in on_group]
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
