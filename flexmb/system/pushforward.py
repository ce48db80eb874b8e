"""Derivatives of everything observable along directions in which a motion may change, eight at once.

A motion has coordinates and speeds, accelerations, loads of closures and a time, all of which are independent here. For
a free motion accelerations and loads follow from the others, and so do their entries in a direction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexmb.closure.given_motion import RowsTangent
from flexmb.entry.given_motion import MotionTangent
from flexmb.entry.observed_tangent import OutputsTangent
from flexmb.entry.tangent import TangentWorkspace
from flexmb.jit.direct import Direct
from flexmb.jit.lanes import LANES
from flexmb.tables.arrays import Constants
from flexmb.typing import Real


class GivenMotion(NamedTuple):
    """Time (s), y = [q, u, work], accelerations (nu,), and loads (G,) of the rows of closures."""

    t: float
    y: Real
    accelerations: Real
    loads: Real


class Directions(NamedTuple):
    """k directions: changes of [q, u] (nq+nu,k), of accelerations (nu,k), of row loads (G,k), of time (k,)."""

    state: Real
    accelerations: Real
    loads: Real
    time: Real


class Pushforward:
    """The tables in dual numbers of one thread, and the kernel (): everything observable of the motion in them."""

    def __init__(
        self,
        tables: tuple[MotionTangent, Constants, TangentWorkspace, OutputsTangent],
        rows: RowsTangent | None,
        observe: Direct,
        check: Callable[[int, int], None],
    ) -> None:
        self.x, self.c, self.w, self.out = tables
        self.rows, self._observe, self._check = rows, observe, check

    def derivatives(self, at: GivenMotion, directions: Directions, read: Callable[[slice], Real]) -> Real:
        """(m,k) derivatives of m numbers; `read` takes those of at most eight directions from the tables, at this
        slice of the last axis of arrays of duals, whose first entry is the value. DynamicsError for connectors beyond
        their range."""
        found = []
        for first in range(0, len(directions.time), LANES):
            some = slice(first, min(first + LANES, len(directions.time)))
            lanes = slice(1, 1 + some.stop - some.start)
            self._set(at, directions, some, lanes)
            self._check(self._observe(), int(self.w.fault[0]))
            found.append(np.array(read(lanes)))
        return np.hstack(found)

    def row(self, lanes: slice) -> Real:
        """(E,lanes) of a row of observed quantities, laid out as `flexmb.system.observables.Observation.columns`."""
        closures = [] if self.rows is None else [self.rows.loads[..., lanes].reshape(-1, lanes.stop - lanes.start)]
        return np.concatenate([self.out.every[:, lanes], self.out.drives[:, lanes], *closures])

    def balance(self, lanes: slice) -> Real:
        """(nu+G,lanes) of what is missing for equilibrium along the speeds, and of the rows' accelerations."""
        rows = [] if self.rows is None else [self.rows.row["acceleration"][:, lanes]]
        return np.concatenate([self.out.drives[:, lanes], *rows])

    def _set(self, at: GivenMotion, directions: Directions, some: slice, lanes: slice) -> None:
        x = self.x
        values = (x.state, at.y), (x.rates, at.accelerations), (x.time, at.t)
        for array, value in values:
            array[:] = 0.0
            array[:, 0] = value
        x.state[:-1, lanes] = directions.state[:, some]
        x.rates[:, lanes] = directions.accelerations[:, some]
        x.time[0, lanes] = directions.time[some]
        if self.rows is not None:
            load = self.rows.row["load"]
            load[:] = 0.0
            load[:, 0], load[:, lanes] = at.loads, directions.loads[:, some]
