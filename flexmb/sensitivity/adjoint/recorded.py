"""The accepted steps of a run: their times, and every so many of their states, as an integrator finds them.

An integrator projects the state at the end of every step that it accepts. The problem that it is given here passes the
right-hand side and the projection on, and keeps what was projected.
"""

from __future__ import annotations

from flexmb.jit.bundle import bundle
from flexmb.jit.direct import nothing_at, status_at
from flexmb.jit.kernel import kernel
from flexmb.typing import Index, Real

# Indices in `RecordedSteps.address` and in that of `flexmb.sensitivity.adjoint.stages.Stages`.
RHS, PROJECT, CONSTANTS, WORKSPACE = range(4)
ADDRESSES = 4


@bundle
class RecordedSteps:
    """The steps of one part of a run; `count` goes on where `time` is full."""

    address: Index  # (ADDRESSES,) of the kernels and tables of the motion
    every: Index  # (1,) how many steps lie between two states that are kept
    count: Index  # (1,) of times; the first is that of the start
    time: Real  # (room,) s
    state: Real  # (rooms,n) at every `every`-th time


@kernel
def rhs(t, y, dy, s, same):
    """dy/dt of the motion; returns a status code. The record is passed for both arguments."""
    return status_at(s.address[RHS], (t, y, dy, s.address[CONSTANTS], s.address[WORKSPACE]))


@kernel
def project(t, y, s):
    """Project y, and keep it as the end of a step.

    A step whose end could not be evaluated is repeated with a smaller size: later times are then no ends of steps.
    """
    nothing_at(s.address[PROJECT], (t, y, s.address[CONSTANTS]))
    room, n = s.time.shape[0], s.count[0]
    while 0 < n <= room and t <= s.time[n - 1]:
        n -= 1
    if n < room:
        s.time[n] = t
        if n % s.every[0] == 0:
            for i in range(y.shape[0]):
                s.state[n // s.every[0], i] = y[i]
    s.count[0] = n + 1
