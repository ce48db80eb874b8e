"""How the motion of a closed chain changes with the state, time and applied forces: its accelerations, its rows' loads.

The accelerations solve M udot = tau - c + J'f with loads f that keep the row accelerations g'' zero. Derivatives by
the state and by forces are read from what one kernel has left (`flexmb.closure.derivative_call`). Those by time are at
constant f along one direction of dual numbers, and the loads follow as they do by the state,

    df = -Lambda d(g'')|f        dudot = d(udot)|f + M^-1 J' df        Lambda = (J M^-1 J')^-1

for the chosen independent rows. Rows that depend on these carry no load: the loads that the motion determines do not
depend on that choice.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure.closures import Closures
from flexmb.closure.derivative_call import (
    ChainDerivativeCall,
    chain_derivative_call,
    chain_stiffness,
    differentiate_chain,
)
from flexmb.closure.tables import Closed
from flexmb.closure.tangent import ClosureTangentWorkspace, change_by_time, closure_tangent_workspace
from flexmb.entry.tangent import TangentWorkspace
from flexmb.entry.variation import (
    ByAllDirections,
    CoordinateMotion,
    FreeVariation,
    RowChanges,
    Stiffness,
    VariedAccelerations,
)
from flexmb.jit.direct import Direct, direct
from flexmb.jit.pointer import MATRIX, REAL, STATUS, VECTOR
from flexmb.kept import kept
from flexmb.tables.functions import any_varies
from flexmb.tables.state import finite_result
from flexmb.tables.status import OK
from flexmb.typing import Index, Real


class ChainVariation:
    """How the motion of one closed chain changes, for one thread; `dual`: tables of its tree for dual numbers."""

    def __init__(self, closures: Closures, dual: TangentWorkspace, like: ChainVariation | None = None) -> None:
        """like: that of closures with other numbers, in tables of the same structure, whose workspaces serve too."""
        self._closures, self._dual = closures, dual
        if like is None:
            c, cc = closures.constants
            self._chain: Closed
            self._x: ChainDerivativeCall
            self._chain, self._x = chain_derivative_call(closures, closures.coordinates, len(c.speed))
            self._rows: ClosureTangentWorkspace = closure_tangent_workspace(cc)
        else:
            self._chain, self._x, self._rows = closures.chain_in(like._chain), like._x, like._rows
        s = self._chain
        self.motion = CoordinateMotion(s.c, len(s.w.q))
        self._differentiate = direct(differentiate_chain, STATUS, REAL, VECTOR, s, self._x)
        rows = s.c, dual, s.cc, self._rows
        self._differentiate_by_time = direct(change_by_time, STATUS, REAL, VECTOR, VECTOR, VECTOR, *rows)
        self._held: Index = np.flatnonzero(s.c.speed["prescribed"] >= 0)
        self._varies = any_varies(s.c.function)

    @property
    def doubt(self) -> Index:
        """(1,) whether a pivot of the tree was at rounding level in the last motion."""
        return self._x.doubt

    def at(self, t: float, y: Real) -> FreeVariation:
        """At y = [q, u, work], which must fulfil the closures; DynamicsError where these are singular."""
        found = self._differentiated(t, y)
        s, x = self._chain, self._x
        changes, place = x.chain.changes, x.chain.tree.tables.place
        nu, chosen = len(place), self._closures.chosen_in(s)
        J, rate = changes.jacobian[:, place], changes.rate[:, place]
        of_loads = changes.load[:, place], changes.load[:, nu + place], x.load_by_force[:, place]
        if len(self._held):
            for part in (rate, *of_loads):
                part[:, self._held] = 0.0
        none = np.zeros(len(J))
        rows = RowChanges(
            s.cw.row["load"].copy(), ByAllDirections(*of_loads, none), chosen, x.unit[place, : len(chosen)], J, rate,
            none,
        )  # fmt: skip
        whole = FreeVariation(*found, rows)
        return self._with_time(t, y, whole) if self._varies else whole

    def of_accelerations(self, t: float, y: Real) -> VariedAccelerations:
        """The same without the rows, which functions of time alone need for the accelerations."""
        if self._varies:
            return VariedAccelerations(*self.at(t, y)[:3])
        return self._differentiated(t, y)

    def _differentiated(self, t: float, y: Real) -> VariedAccelerations:
        """The same with functions of time held at their values; the rows are then in the tables."""
        x = self._x
        self._closures.expect_rows(self._chain)
        status = self._differentiate(t, y)
        if status != OK:
            self._closures.check(status, int(x.fault[0]))
        rates = x.speed["acceleration"].copy()
        of_rates = ByAllDirections(x.by_displacement.copy(), x.by_speed.copy(), x.by_force.copy(), np.zeros(len(rates)))
        return VariedAccelerations(rates, of_rates, self.motion.at(y))

    @kept
    def _stiffen(self) -> Direct:
        return direct(chain_stiffness, STATUS, REAL, VECTOR, VECTOR, MATRIX, MATRIX, self._chain, self._x)

    def stiffness(self, t: float, y: Real) -> Stiffness:
        """At y = [q, u, work], as `at`."""
        x, nu = self._x, len(self._x.speed)
        rates, stiffness, mass = np.empty(nu), np.empty((nu, nu)), np.empty((nu, nu))
        self._closures.expect_rows(self._chain)
        self._closures.check(self._stiffen(t, y, rates, stiffness, mass), int(x.fault[0]))
        J = x.chain.changes.jacobian[:, x.chain.tree.tables.place]
        return Stiffness(rates, stiffness, mass, J, self.motion.at(y))

    def _with_time(self, t: float, y: Real, found: FreeVariation) -> FreeVariation:
        """The same with derivatives by time."""
        n, rows, nu = len(y), found.rows, len(found.accelerations)
        out = np.zeros(n + 2 * len(rows.loads))
        self._closures.check(self._differentiate_by_time(t, y, rows.loads, out), int(self._dual.fault[0]))
        free, (of_row_rates, opening) = finite_result(out, t)[n - 1 - nu : n - 1], np.split(out[n:], 2)
        return found._replace(
            of_accelerations=found.of_accelerations._replace(by_time=free - rows.lever @ opening),
            rows=rows._replace(
                of_loads=rows.of_loads._replace(by_time=-rows.inertia @ opening), rates_by_time=of_row_rates
            ),
        )
