"""How the motion of a closed chain changes with the state, time and applied forces: its accelerations, its rows' loads.

The accelerations solve M udot = tau - c + J'f with loads f that keep the row accelerations g'' zero. Derivatives by
the state and by forces are read from what one kernel has left (`flexmb.closure.derivative_call`). Those by time are at
constant f along one direction of dual numbers, and the loads follow as they do by the state,

    df = -Lambda d(g'')|f        dudot = d(udot)|f + M^-1 J' df        Lambda = (J M^-1 J')^-1

for the chosen independent rows. Rows that depend on these carry no load: the loads that the motion determines do not
depend on that choice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.closure.closures import Closures
from flexmb.closure.derivative_call import ChainDerivativeCall, chain_derivative_call, differentiate_chain
from flexmb.closure.tables import Closed
from flexmb.closure.tangent import ClosureTangentWorkspace, change_by_time, closure_tangent_workspace
from flexmb.entry.tangent import TangentWorkspace
from flexmb.entry.variation import ByAllDirections, RowChanges
from flexmb.typing import Index, Real


class ChainChange(NamedTuple):
    """Accelerations (nu,) and loads (G,) of the rows, with their derivatives and those of the rows' rates J u.

    J (G,nu) is that of all speeds; columns of prescribed coordinates and speeds of all else vanish.
    """

    accelerations: Real
    of_accelerations: ByAllDirections
    rows: RowChanges
    J: Real
    rates_by_displacement: Real
    rates_by_time: Real


class ChainVariation:
    """The closures of one scene, of one thread; `w`: tables of its tree for dual numbers."""

    def __init__(self, closures: Closures, w: TangentWorkspace, like: ChainVariation | None = None) -> None:
        """like: that of closures with other numbers, in tables of the same structure, whose workspaces serve too."""
        self._closures, self._w = closures, w
        if like is None:
            self._chain: Closed
            self._x: ChainDerivativeCall
            nu = len(closures.constants[0].speed)
            self._chain, self._x = chain_derivative_call(closures, closures.coordinates, nu)
            self._rows: ClosureTangentWorkspace = closure_tangent_workspace(closures.constants[1])
        else:
            self._chain, self._x, self._rows = closures.chain_in(like._chain), like._x, like._rows

    @property
    def doubt(self) -> Index:
        """(1,) whether a pivot of the tree was at rounding level in the last motion."""
        return self._x.doubt

    def at(self, t: float, y: Real) -> ChainChange:
        """At y = [q, u, work], which must fulfil the closures; DynamicsError where these are singular."""
        s, x = self._chain, self._x
        self._closures.expect_rows(s)
        self._closures.check(differentiate_chain(t, y, s, x), int(x.fault[0]))
        changes, d = x.chain.changes, x.chain.tree.tables
        place, nu, chosen = d.place, len(d.place), self._closures.chosen_in(s)
        held = np.flatnonzero(s.c.speed["prescribed"] >= 0)
        J, rate = changes.jacobian[:, place], changes.rate[:, place]
        of_loads = changes.load[:, place], changes.load[:, nu + place], x.load_by_force[:, place]
        for part in (rate, *of_loads):
            part[:, held] = 0.0
        response = J[chosen] @ x.unit[place, : len(chosen)]
        rows = RowChanges(s.cw.row["load"].copy(), ByAllDirections(*of_loads, np.zeros(len(J))), chosen, response)
        by_state = x.by_displacement.copy(), x.by_speed.copy(), x.by_force.copy()
        rates = x.speed["acceleration"].copy()
        found = ChainChange(rates, ByAllDirections(*by_state, np.zeros(nu)), rows, J, rate, np.zeros(len(J)))
        return self._with_time(t, y, found) if len(s.c.function) else found

    def _with_time(self, t: float, y: Real, found: ChainChange) -> ChainChange:
        """The same with derivatives by time."""
        c, n, rows, nu = self._chain.c, len(y), found.rows, len(found.accelerations)
        out = np.zeros(n + 2 * len(rows.loads))
        tables = c, self._w, self._chain.cc, self._rows
        self._closures.check(change_by_time(t, y, rows.loads, out, *tables), int(self._w.fault[0]))
        free, of_rates, opening = out[n - 1 - nu : n - 1], *np.split(out[n:], 2)
        return found._replace(
            of_accelerations=found.of_accelerations._replace(by_time=free - rows.lever @ opening),
            rows=rows._replace(of_loads=rows.of_loads._replace(by_time=-rows.inertia @ opening)),
            rates_by_time=of_rates,
        )
