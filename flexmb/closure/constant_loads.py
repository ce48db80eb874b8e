"""How the accelerations of a closed chain and those of its rows change with the state while the rows' loads stay.

From these the changes of the loads follow by linear algebra, in `flexmb.closure.variation` so that the rows keep their
accelerations, in `flexmb.linear.closed_variations` along what closures allow. By displacements and speeds they come
from the recursion (`flexmb.closure.changes`), by time from dual numbers along one direction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexmb.closure.changes import differentiate
from flexmb.closure.closures import Closures
from flexmb.closure.forces import accelerate, free_tree
from flexmb.closure.jacobian import ChainJacobian, chain_jacobian, factors
from flexmb.closure.tables import Closed
from flexmb.closure.tangent import ClosureTangentWorkspace, change_by_time, closure_tangent_workspace
from flexmb.entry.tangent import TangentWorkspace
from flexmb.jain.derivatives.solve import solve
from flexmb.jit.kernel import helper, kernel
from flexmb.motion.coordinates import load_state
from flexmb.tables.status import OK
from flexmb.typing import Real

RATES, JACOBIAN, ACCELERATIONS, BY_SPEED = range(4)  # of the rows, in `change_by_state`


class Changes(NamedTuple):
    """Of m numbers by displacements along the speeds (m,nu), by speeds (m,nu), and by time (m,)."""

    by_displacement: Real
    by_speed: Real
    by_time: Real


class AtConstantLoads(NamedTuple):
    """Changes of udot (nu,), of the rows' rates J u (G,), by speed J itself, and of their accelerations (G,).

    Columns of prescribed coordinates and speeds vanish, but for those of J.
    """

    of_accelerations: Changes
    of_row_rates: Changes
    of_row_accelerations: Changes


class ConstantLoads:
    """`changes(t, y, load)` of the closures of one scene; `w`: tables for dual numbers."""

    def __init__(self, closures: Closures, w: TangentWorkspace, like: ConstantLoads | None = None) -> None:
        """like: those of closures with other numbers, in tables of the same structure, whose workspaces serve too."""
        self._check, self._w = closures.check, w
        if like is None:
            c, cc = closures.constants
            self._chain: Closed = closures.chain("articulated")
            self._x: ChainJacobian = chain_jacobian(self._chain, len(self._chain.w.q), len(c.speed))
            self._rows: ClosureTangentWorkspace = closure_tangent_workspace(cc)
        else:
            self._chain, self._x, self._rows = closures.chain_in(like._chain), like._x, like._rows

    def changes(self, t: float, y: Real, load: Real) -> AtConstantLoads:
        """At y = [q, u, work] with loads (G,) of the rows."""
        c, nu, G = self._chain.c, len(self._chain.c.speed), len(load)
        of_rates, of_rows = np.empty((2, nu, nu)), np.empty((4, G, nu))
        self._check(change_by_state(t, y, load, of_rates, of_rows, self._chain, self._x), int(self._chain.fault[0]))
        prescribed = c.speed["prescribed"] >= 0
        of_rates[:, :, prescribed] = 0.0
        for kind in (RATES, ACCELERATIONS, BY_SPEED):
            of_rows[kind][:, prescribed] = 0.0
        pairs = of_rates, of_rows[[RATES, JACOBIAN]], of_rows[[ACCELERATIONS, BY_SPEED]]
        by_time = self._by_time(t, y, load)
        return AtConstantLoads(*(Changes(*pair, time) for pair, time in zip(pairs, by_time, strict=True)))

    def _by_time(self, t: float, y: Real, load: Real) -> tuple[Real, Real, Real]:
        c, G = self._chain.c, len(load)
        out = np.zeros(len(y) + 2 * G)
        if len(c.function):
            tables = c, self._w, self._chain.cc, self._rows
            self._check(change_by_time(t, y, load, out, *tables), int(self._w.fault[0]))
        n = len(y)
        return out[n - 1 - len(c.speed) : n - 1], out[n : n + G], out[n + G :]


@kernel
def change_by_state(t, y, load, of_rates, of_rows, s, x):
    """Changes (2,nu,nu) of udot by displacement and by speed, and (4,G,nu) of the rows; returns a status code.

    Of the rows: RATES by displacement, JACOBIAN, ACCELERATIONS by displacement and, of these, BY_SPEED.
    """
    load_state(t, y, s.c, s.w)
    status = free_tree(s.route, s)
    if status != OK:
        return status
    for r in range(load.shape[0]):
        s.cw.row[r].load = load[r]
    accelerate(s.route, s)
    c, w, d, nu = s.c, x.tree.sweeps, x.tree.tables, of_rates.shape[1]
    status = factors(s.route, t, y, s, w)
    if status != OK:
        return status
    differentiate(c, w, d, s.cc, s.cw, x.changes, False, True)
    solve(c, w, d, 2 * nu)
    for i in range(nu):
        row = d.matrix[d.place[i]]
        for j in range(nu):
            of_rates[0, i, j], of_rates[1, i, j] = row[d.place[j]], row[nu + d.place[j]]
    _in_order(d, x.changes.rate, of_rows[RATES])
    _in_order(d, x.changes.jacobian, of_rows[JACOBIAN])
    _in_order(d, x.changes.by_displacement, of_rows[ACCELERATIONS])
    _in_order(d, x.changes.by_speed, of_rows[BY_SPEED])
    for r in range(load.shape[0]):
        _add_accelerations(of_rows[JACOBIAN, r], of_rates[0], of_rows[ACCELERATIONS, r])
        _add_accelerations(of_rows[JACOBIAN, r], of_rates[1], of_rows[BY_SPEED, r])
    return OK


@helper
def _in_order(d, given, out):
    """The columns of `given` in the order of u."""
    for r in range(out.shape[0]):
        for j in range(out.shape[1]):
            out[r, j] = given[r, d.place[j]]


@helper
def _add_accelerations(J, of_accelerations, row):
    """row += J of_accelerations, by the free speeds."""
    for i in range(J.shape[0]):
        if J[i] != 0.0:
            for j in range(row.shape[0]):
                row[j] += J[i] * of_accelerations[i, j]
