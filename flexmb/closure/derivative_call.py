"""Derivatives of a closed chain's accelerations and loads: all that a call writes is in one bundle.

As in `flexmb.closure.jacobian`, with the rows chosen anew at every state and not stabilised. M^-1 J' of these rows
comes with it; a force on a speed changes the accelerations by a column of M^-1 and the loads f so that the rows stay,

    Lambda^-1 f = -J M^-1,    by_force = M^-1 + M^-1 J' f.

An evaluator calls it behind its gate; `flexmb.closure.variation` reads everything else from the bundle.
"""

from __future__ import annotations

import math

import numpy as np

from flexmb.closure.changes import differentiate
from flexmb.closure.closures import Closures
from flexmb.closure.factor import solve as solve_rows
from flexmb.closure.forces import DELICATE_CHANGES, accelerate, choose, free_tree, is_delicate, refine, row_loads
from flexmb.closure.jacobian import ChainJacobian, chain_jacobian, factors, hold_rows, put_rows
from flexmb.closure.sizes import measure_ports
from flexmb.closure.tables import Closed
from flexmb.entry.derivatives import copy_third
from flexmb.jain.derivatives.solve import solve
from flexmb.jain.derivatives.sweeps import stop
from flexmb.jit.bundle import bundle
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.motion.coordinates import load_state
from flexmb.tables.features import PRESCRIBED
from flexmb.tables.status import NONFINITE, OK
from flexmb.typing import Index, Real, Record


@bundle
class ChainDerivativeCall:
    """Results (nu,nu), and the workspace. In the order of places: `unit` (nu,nu), M^-1 J' of the chosen rows, and
    `load_by_force` (G,nu); what the rows' loads, rates and accelerations do else is in `chain.changes`."""

    by_displacement: Real
    by_speed: Real
    by_force: Real
    unit: Real
    load_by_force: Real
    chain: ChainJacobian

    @property
    def speed(self) -> Record:
        """(nu,) SPEED_STATE, where the kernel leaves udot."""
        return self.chain.tree.sweeps.speed

    @property
    def doubt(self) -> Index:
        """(1,) whether an evaluation met a pivot that may consist of rounding errors."""
        return self.chain.tree.sweeps.doubt

    @property
    def fault(self) -> Index:
        """(1,) body or closure where an evaluation failed."""
        return self.chain.tree.sweeps.fault


def chain_derivative_call(closures: Closures, nq: int, nu: int) -> tuple[Closed, ChainDerivativeCall]:
    """What `differentiate_chain` takes after t and y, of closures with counted independent rows; one per thread."""
    chain = closures.chain("articulated")
    by_displacement, by_speed, by_force, unit = (np.zeros((nu, nu)) for _ in range(4))
    of_loads = np.zeros((len(chain.cc.row), nu))
    x = ChainDerivativeCall(by_displacement, by_speed, by_force, unit, of_loads, chain_jacobian(chain, nq, nu))
    return chain, x


@kernel
def differentiate_chain(t, y, s, x):
    """udot and its derivatives at y = [q, u, work], which fulfils the closures; returns a status code.

    CLOSURE_SINGULAR where fewer rows are independent than were counted, NONFINITE where a derivative overflows.
    """
    status = _motion(t, y, s)
    if status == OK:
        status = factors(s.route, t, y, s, x.chain.tree.sweeps)
    if status != OK:
        return status
    changes, w, d = x.chain.changes, x.chain.tree.sweeps, x.chain.tree.tables
    differentiate(s.c, w, d, s.cc, s.cw, changes, False, True)
    count = put_rows(d, s.cc, s.cw, changes)
    solve(s.c, w, d, 2 * x.by_speed.shape[0] + count)
    hold_rows(d, s.cc, s.cw, changes)
    _copy(s.c, d, 0, x.by_displacement)
    _copy(s.c, d, 1, x.by_speed)
    _respond_to_forces(s, x, count)
    finite = _is_finite(x.by_displacement) and _is_finite(x.by_speed) and _is_finite(x.by_force)
    return OK if finite else NONFINITE


@kernel
def chain_stiffness(t, y, rates, stiffness, mass, s, x):
    """udot (nu,) at y = [q, u, work], the tangent stiffness (nu,nu) and M, and J in `chain.changes`; a status code.

    As `flexmb.entry.derivatives.stiffness_and_mass`; the loads of the rows act and stay.
    """
    status = _motion(t, y, s)
    if status == OK:
        status = factors(s.route, t, y, s, x.chain.tree.sweeps)
    if status == OK:
        w, d = x.chain.tree.sweeps, x.chain.tree.tables
        for j in range(rates.shape[0]):
            rates[j] = w.speed[j].acceleration
        stop(s.c, w)
        differentiate(s.c, w, d, s.cc, s.cw, x.chain.changes, True, False)
        copy_third(d, 0, stiffness)
        copy_third(d, 2, mass)
    return status


@helper
def _motion(t, y, s):
    """The motion under the loads of independent rows; returns a status code."""
    load_state(t, y, s.c, s.w)
    status = free_tree(s.route, s)
    if status == OK:
        measure_ports(s)
        status = choose(s.w, s.cc, s.cw)
    if status == OK:
        status = row_loads(s.w, s.cc, s.cw)
    if status == OK:
        accelerate(s.route, s)
        refine(s.route, s)
    return status


@sweep
def _respond_to_forces(s, x, count):
    """x.by_force and x.load_by_force, after the columns of `count` chosen rows were solved for."""
    d, nu = x.chain.tree.tables, x.by_force.shape[0]
    for r in range(x.load_by_force.shape[0]):
        for place in range(nu):
            x.load_by_force[r, place] = 0.0
    for place in range(nu):
        row = d.matrix[place]
        for n in range(count):
            x.unit[place, n] = row[2 * nu + n]
        for n in range(nu):
            row[n] = 0.0
        row[place] = -1.0
    solve(s.c, x.chain.tree.sweeps, d, nu)
    delicate = is_delicate(s.cc, s.cw, DELICATE_CHANGES)
    for place in range(nu):
        _stop_column(s, x, place, False)
        if delicate:
            _stop_column(s, x, place, True)
    _copy(s.c, d, 0, x.by_force)


@sweep
def _stop_column(s, x, place, again):
    """Add to a column of M^-1 what keeps the rows; `again`: what rounding has left of their accelerations."""
    d, J, n = x.chain.tree.tables, x.chain.changes.jacobian, 0
    for g in range(s.cc.group.shape[0]):
        first = s.cc.group[g].row_start
        for at in range(first, first + s.cw.rank[g]):
            opening = x.unit[place, n]
            if again:
                opening = 0.0
                for i in range(x.unit.shape[0]):
                    opening += J[s.cw.chosen[at], i] * d.matrix[i, place]
            s.cw.scratch[at] = -opening
            n += 1
    solve_rows(s.cc, s.cw)
    n = 0
    for g in range(s.cc.group.shape[0]):
        first = s.cc.group[g].row_start
        for at in range(first, first + s.cw.rank[g]):
            load = s.cw.solution[s.cw.chosen[at]]
            x.load_by_force[s.cw.chosen[at], place] += load
            for i in range(x.unit.shape[0]):
                d.matrix[i, place] += x.unit[i, n] * load
            n += 1


@helper
def _copy(c, d, third, out):
    """One third of the columns of `matrix` to out (nu,nu), in the order of u; columns of what is prescribed vanish."""
    copy_third(d, third, out)
    if has(c, PRESCRIBED):
        for j in range(out.shape[0]):
            if c.speed[j].prescribed >= 0:
                for i in range(out.shape[0]):
                    out[i, j] = 0.0


@helper
def _is_finite(a):
    finite = True
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            finite &= math.isfinite(a[i, j])
    return finite
