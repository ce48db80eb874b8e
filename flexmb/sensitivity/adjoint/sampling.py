"""Sampled controllers in a run that is passed backwards: what their instants do to derivatives, and what they hold.

Between two instants the outputs of sampled controllers are constant, and so is what they drive: the motion is that of
the mechanics alone, with these values as further parameters. At an instant the signals and states of controllers change
as functions of the state, of themselves and of the numbers of the laws; the loop in dual numbers finds the derivatives.
Outputs that are applied after a delay wait in rows of a table.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from flexmb.closure.tables import Closed
from flexmb.control import variation
from flexmb.control.tables import APPLY
from flexmb.jit.duals import RATES
from flexmb.jit.kernel import kernel
from flexmb.sensitivity.leg import Course, Variation
from flexmb.sensitivity.loops import Loops
from flexmb.typing import Index, Real


class ActedInstant(NamedTuple):
    """What happens at one time (s) along the directions before it.

    memory (M,D): how the signals and then the states of all controllers change; rows: likewise outputs that wait, by
    number of the row; applied: the rows that become signals, with the place of the first of these. driven (F,D): how
    what controllers drive changes with the memory and parameters after the instant, values (F,).
    """

    t: float
    memory: Real
    rows: dict[int, Real]
    applied: list[tuple[int, slice]]
    driven: Real
    values: Real


class SampledLoop:
    """The instants of one part of a run. Directions of signals, then of states of controllers, begin at `first`."""

    def __init__(self, variation: Variation, loops: Loops, first: int, directions: int) -> None:
        self._variation, self._loops, self._directions = variation, loops, directions
        self._signals, self._states = len(loops.tables[0].signal), len(loops.tables[0].state)
        self._along = np.zeros((self.size, directions))
        self._along[:, first : first + self.size] = np.eye(self.size)
        self._waiting: list[int] = []
        self._set_lanes()

    @property
    def size(self) -> int:
        """Number of signals and states."""
        return self._signals + self._states

    def times(self, start: float, stop: float, ends: bool) -> list[float]:
        """The instants (s) from `start` on, before `stop`, or up to it if the run `ends` there."""
        table = self._loops.tables[0]
        t = np.unique(table.instant["time"][table.following[0] :, 0])
        return [time for time in t.tolist() if start <= time and (time < stop or ends and time <= stop)]

    def acted(self, t: float, at: Course) -> ActedInstant:
        """The controllers that are due at t (s) act at the state `at`."""
        tables, schedule = self._loops.tables, self._loops.tables[0].instant
        begun = int(tables[0].following[0])
        self._variation.take(at)
        self._set_lanes()
        for table in tables:
            self._loops.blocks.check(variation.steer(t, table))
        due = schedule[begun : int(tables[0].following[0])]
        rows, applied = dict[int, Real](), list[tuple[int, slice]]()
        for row in due:
            number, controller = int(row["row"]), tables[0].controller[int(row["controller"])]
            if int(row["kind"]) == APPLY:
                first = int(controller["signal"])
                applied.append((number, slice(first, first + int(controller["outputs"]))))
            elif not row["immediate"]:
                rows[number] = self._joined("held", number)[: int(controller["outputs"])]
        memory = np.vstack([self._joined("signal"), self._joined("state")])
        self._waiting = [int(row["row"]) for row in due]
        self._set_lanes()
        return ActedInstant(t, memory, rows, applied, *self._driven())

    def held(self, t: float) -> ActedInstant:
        """Nothing happens at t: what is driven there."""
        return ActedInstant(t, self._along, {}, [], *self._driven())

    def _driven(self) -> tuple[Real, Real]:
        """Derivatives (F,D) and values (F,) of what controllers drive."""
        tables = self._loops.tables
        drive, gains = tables[0].drive, self._loops.blocks.joined([table.drive["gain"] for table in tables])
        gain, signal = drive["gain"][:, 0], tables[0].signal[drive["signal"], 0]
        return gain[:, None] * self._along[drive["signal"]] + signal[:, None] * gains, gain * signal

    def _joined(self, name: str, row: int | None = None) -> Real:
        arrays = [getattr(table, name) for table in self._loops.tables]
        return self._loops.blocks.joined([array if row is None else array[row] for array in arrays])

    def _set_lanes(self) -> None:
        """Signals and states change along their own directions, and outputs that wait along none."""
        for b, tables in enumerate(self._loops.tables):
            own = self._along[:, RATES * b : RATES * (b + 1)]
            tables.signal[:, 1 : 1 + own.shape[1]] = own[: self._signals]
            tables.state[:, 1 : 1 + own.shape[1]] = own[self._signals :]
            tables.held[self._waiting, :, 1:] = 0.0


class DrivenFunctions(NamedTuple):
    """Functions of time (F,) that controllers drive, and all constants that have them; of closed chains their `Closed`,
    too."""

    functions: Index
    constants: Sequence[Any]

    def hold(self, values: Real) -> None:
        """Set their values (F,)."""
        for constant in self.constants:
            hold(constant.c if isinstance(constant, Closed) else constant, self.functions, values)


@kernel
def hold(c, functions, values):
    """Set the values of functions of time; derivatives of dual ones stay."""
    for i in range(functions.shape[0]):
        x = c.function[functions[i]].data[0]
        c.function[functions[i]].data[0] = x + (values[i] - x.real)
