"""Evaluates all observables at the samples of a run, as rows of numbers; in compiled code where that is possible."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple, Protocol

import numpy as np

from flexmb.entry.sampling import observe_samples
from flexmb.jit.direct import addresses, bound, settled
from flexmb.jit.pointer import INDEX, MATRIX, REAL, STATUS, VECTOR, VOID
from flexmb.system.algorithm import Algorithm
from flexmb.system.observables import Observation
from flexmb.tables.state import DynamicsError
from flexmb.typing import Real

PATIENCE = 0.05  # s that compiled code may take between checks for Ctrl-C

Sampler = Callable[[Real, Real, Real], int]


class Rows(NamedTuple):
    """Observables at the first T samples, (T,m) as in `Observation.columns`, and the exception that stopped it."""

    rows: Real
    trouble: DynamicsError | KeyboardInterrupt | None


class Observed(Protocol):
    """A system, or a closed loop of one with its controllers, whose observables can be evaluated."""

    @property
    def observation(self) -> Observation: ...

    def observe_row(self, t: float, y: Real, algorithm: Algorithm, row: Real) -> None: ...


def batch(observed: Observed, motion: tuple[Any, ...], observing: Any, n: int) -> Sampler:
    """A function of times (T,), states (T,n) and rows (T,m) that fills rows and returns their number; it stops before
    the first sample that raises an error or a warning, which is left to Python. It uses output arrays of its own.

    motion: a right-hand side with its constants and workspace; `observing`: a kernel that takes these and the outputs.
    """
    rhs, constants, workspace = motion
    out, slope = observed.observation.outputs(), np.empty(n)
    entry = settled(observe_samples, INDEX, INDEX, VECTOR, MATRIX, VECTOR, MATRIX)
    moving = addresses(rhs, STATUS, REAL, VECTOR, VECTOR, constants, workspace)
    found, *_, outputs = addresses(observing, VOID, constants, workspace, out)
    where = np.array([*moving, found, outputs])
    call = bound(entry, (), constants, workspace, out)
    return lambda times, states, rows: call(where, workspace.doubt, times, states, slope, rows)


def observe(
    system: Observed, algorithm: Algorithm, times: Real, states: Real, sampled: Sampler | None, many: int = 1
) -> Rows:
    """Rows at all states (T,n), which belong to the first T of these times, up to a failure or Ctrl-C.

    `sampled` evaluates many samples at once, at first `many`; those it leaves out are evaluated singly, with their
    errors and warnings.
    """
    rows, done = np.zeros((len(states), system.observation.width)), 0
    try:
        while done < len(states):
            if sampled is not None:
                start, some = perf_counter(), slice(done, min(done + many, len(states)))
                done += sampled(times[some], states[some], rows[some])
                many = 2 * many if perf_counter() - start < PATIENCE / 2.0 else max(1, many // 2)
                if done == some.stop:
                    continue
            system.observe_row(float(times[done]), states[done], algorithm, rows[done])
            done += 1
    except (DynamicsError, KeyboardInterrupt) as trouble:
        return Rows(rows[:done], trouble)
    return Rows(rows, None)
