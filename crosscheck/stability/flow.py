"""The flow of a scene near a motion, found by runs: the growth of small disturbances.

Each chosen coordinate or speed is disturbed by `SIZE` and integrated for some time. The disturbances at the end give
the transition matrix of the linearised motion, up to SIZE^2 and to rounding over SIZE. Its eigenvalues are Floquet's
multipliers if that time is a period."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.integrate.control import COUNTS
from flexmb.integrate.dop853 import dop853
from flexmb.integrate.memory import memory
from flexmb.integrate.problem import Accuracy, Clock
from flexmb.integrate.watch import nothing_watched
from flexmb.run.propagate import recursion
from flexmb.system.system import System
from flexmb.tables.state import pack
from flexmb.tables.status import OK, Status
from flexmb.typing import Real

SIZE = 1e-6
RTOL, ATOL = 1e-12, 1e-16
MAX_STEPS = 1_000_000


class StoppedError(ArithmeticError):
    """A run did not reach its end; `status` says why."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.advice)
        self.status = status


def flow(system: System, start: Real, time: float) -> Real:
    """State [q, u, work] at `time` (s) of the motion from `start`; StoppedError if it ends before."""
    times, out = np.array([0.0, time]), np.empty((2, len(start)))
    counts, accuracy = np.zeros(COUNTS, np.int64), Accuracy(RTOL, ATOL, system.nq + system.nu, MAX_STEPS)
    equations = recursion(system.recursion_constants, system.recursion_workspace())
    clock, begins = Clock(times, times[1:]), memory(len(start), 0)
    status, _ = dop853(equations, start.copy(), clock, accuracy, out, counts, begins, nothing_watched())
    if status != OK:
        raise StoppedError(Status(status))
    return np.asarray(out[1])


def transition_matrix(system: System, places: Sequence[int], time: float) -> Real:
    """(n,n): the change of disturbances of the states at `places` of the scene's motion after `time` (s)."""
    start = pack(system.initial_state)
    columns = []
    for place in places:
        ends = []
        for sign in (1.0, -1.0):
            moved = start.copy()
            moved[place] += sign * SIZE
            ends.append(flow(system, moved, time)[list(places)])
        columns.append((ends[0] - ends[1]) / (2.0 * SIZE))
    return np.array(columns).T


def growth_rate(system: System, places: Sequence[int], time: float) -> float:
    """Largest real part (1/s) of the exponents of disturbances over `time` (s)."""
    multipliers = np.linalg.eigvals(transition_matrix(system, places, time))
    return float(np.log(np.max(np.abs(multipliers))) / time)
