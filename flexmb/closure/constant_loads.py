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

    def __init__(self, closures: Closures, w: TangentWorkspace) -> None:
        self._check, self._w = closures.check, w
        self._chain: Closed = closures.chain("articulated")
        c, cc = closures.constants
        self._x: ChainJacobian = chain_jacobian(self._chain, len(self._chain.w.q), len(c.speed))
        self._rows: ClosureTangentWorkspace = closure_tangent_workspace(cc)

    def changes(self, t: float, y: Real, load: Real) -> AtConstantLoads:
        """At y = [q, u, work] with loads (G,) of the rows."""
        c, nu, G = self._chain.c, len(self._chain.c.speed), len(load)
        parts = [np.empty((rows, nu)) for rows in (nu, nu, G, G, G, G)]
        self._check(change_by_state(t, y, load, *parts, self._chain, self._x), int(self._chain.fault[0]))
        prescribed = c.speed["prescribed"] >= 0
        for part in (*parts[:2], parts[2], *parts[4:]):
            part[:, prescribed] = 0.0
        pairs = zip(parts[::2], parts[1::2], self._by_time(t, y, load), strict=True)
        return AtConstantLoads(*(Changes(*each) for each in pairs))

    def _by_time(self, t: float, y: Real, load: Real) -> tuple[Real, Real, Real]:
        c, G = self._chain.c, len(load)
        out = np.zeros(len(y) + 2 * G)
        if len(c.function):
            tables = c, self._w, self._chain.cc, self._rows
            self._check(change_by_time(t, y, load, out, *tables), int(self._w.fault[0]))
        n = len(y)
        return out[n - 1 - len(c.speed) : n - 1], out[n : n + G], out[n + G :]


@kernel
def change_by_state(t, y, load, by_displacement, by_speed, rates, J, rows, rows_by_speed, s, x):
    """Changes (nu,nu) of udot by displacement and speed, (G,nu) of the rows' rates and accelerations; a status code."""
    load_state(t, y, s.c, s.w)
    status = free_tree(s.route, s)
    if status != OK:
        return status
    for r in range(load.shape[0]):
        s.cw.row[r].load = load[r]
    accelerate(s.route, s)
    c, w, d, nu = s.c, x.tree.sweeps, x.tree.tables, by_speed.shape[0]
    status = factors(s.route, t, y, s, w)
    if status != OK:
        return status
    differentiate(c, w, d, s.cc, s.cw, x.changes, False, True)
    solve(c, w, d, 2 * nu)
    for i in range(nu):
        row = d.matrix[d.place[i]]
        for j in range(nu):
            by_displacement[i, j], by_speed[i, j] = row[d.place[j]], row[nu + d.place[j]]
    _in_order(d, x.changes.rate, rates)
    _in_order(d, x.changes.jacobian, J)
    _in_order(d, x.changes.by_displacement, rows)
    _in_order(d, x.changes.by_speed, rows_by_speed)
    for r in range(load.shape[0]):
        _add_accelerations(J[r], by_displacement, rows[r])
        _add_accelerations(J[r], by_speed, rows_by_speed[r])
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
