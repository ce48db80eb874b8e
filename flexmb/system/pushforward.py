"""Derivatives of everything observable along directions in which a motion may change, seven at once.

A motion has coordinates and speeds, accelerations, loads of closures and a time, all of which are independent here. For
a free motion accelerations and loads follow from the others, and so do their entries in a direction.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flexmb.closure import given_motion as of_chains
from flexmb.closure.given_motion import RowsTangent, rows_tangent
from flexmb.closure.tables import ClosureConstants
from flexmb.entry import given_motion as of_trees
from flexmb.entry.given_motion import MotionTangent, motion_tangent
from flexmb.entry.observation import Outputs
from flexmb.entry.observed_tangent import OutputsTangent, outputs_tangent
from flexmb.entry.tangent import TangentWorkspace
from flexmb.jit.direct import Direct, direct
from flexmb.jit.duals import RATES
from flexmb.jit.pointer import STATUS
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


def pushforward(
    c: Constants,
    w: TangentWorkspace,
    out: Outputs,
    check: Callable[[int, int], None],
    closures: ClosureConstants | None = None,
) -> Pushforward:
    """Of a tree, or of a chain with closures, for one thread; `out`: outputs of the shapes and markers wanted."""
    x, outputs = motion_tangent(len(w.q), len(w.u)), outputs_tangent(out)
    tables = x, c, w, outputs
    if closures is None:
        return Pushforward(tables, None, direct(of_trees.observe_given, STATUS, *tables), check)
    rows = rows_tangent(closures, c)
    return Pushforward(tables, rows, direct(of_chains.observe_given, STATUS, x, c, w, closures, rows, outputs), check)


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
        """(m,k) derivatives of m numbers; `read` takes those of at most seven directions from the tables, at this
        slice of the last axis of arrays of duals, whose first entry is the value. DynamicsError for connectors beyond
        their range."""
        derivatives = []
        for first in range(0, max(1, len(directions.time)), RATES):
            some = slice(first, min(first + RATES, len(directions.time)))
            lanes = slice(1, 1 + some.stop - some.start)
            self._set(at, directions, some, lanes)
            self._check(self._observe(), int(self.w.fault[0]))
            derivatives.append(np.array(read(lanes)))
        return derivatives[0] if len(derivatives) == 1 else np.hstack(derivatives)

    def value(self, at: GivenMotion) -> Real:
        """The row (E,) of a motion."""
        state, rates, loads = (np.zeros((n, 0)) for n in (len(at.y) - 1, len(at.accelerations), len(at.loads)))
        self.derivatives(at, Directions(state, rates, loads, np.zeros(0)), self.row)
        return self.row(slice(0, 1))[:, 0]

    def row(self, lanes: slice) -> Real:
        """(E,lanes) of a row of observed quantities, laid out as `flexmb.system.observables.Observation.columns`."""
        loads = None if self.rows is None else self.rows.loads
        closures = [] if loads is None else [loads[..., lanes].reshape(6 * len(loads), lanes.stop - lanes.start)]
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
