"""The Jacobian of a closed chain's equations of motion, exact to round-off, by the recursion of the tree.

The equations are those of all coordinates, `flexmb.closure.dynamics.rhs`: constraint loads f keep the row
accelerations g'' zero, or make g decay. They are also defined off the constraint manifold, where the stages and
iterates of implicit methods lie, so they are differentiated in all directions, as those of a tree. With the changes X
of the tree's accelerations and dg'' of the rows at constant loads (`flexmb.closure.changes`),

    Lambda^-1 df = -(J X + dg''),    dudot = X + M^-1 J' df.

The normal equations lose digits where bodies are light, as those of the loads themselves do (`is_delicate`): there a
second solution removes what the first has left of the rows' accelerations.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure.changes import ChainChanges, chain_changes, differentiate, tree_derivatives
from flexmb.closure.dynamics import slope
from flexmb.closure.factor import solve as solve_rows
from flexmb.closure.forces import DELICATE_CHANGES, is_delicate
from flexmb.closure.tables import Closed, Recursion
from flexmb.entry.derivatives import DerivativeWorkspace, store_jacobian
from flexmb.jain.derivatives.solve import solve
from flexmb.jain.derivatives.work import differentiate_power
from flexmb.jain.kinematics import pose_sweep
from flexmb.jain.sweeps import forward_dynamics
from flexmb.jit.bundle import bundle
from flexmb.jit.features import has
from flexmb.jit.kernel import by_bundle, helper, kernel, sweep
from flexmb.motion import retraction
from flexmb.motion.coordinates import load_state
from flexmb.tables.features import PRESCRIBED
from flexmb.tables.status import OK
from flexmb.tables.workspaces import workspace
from flexmb.typing import Real


@bundle
class ChainJacobian:
    """Workspace of a Jacobian, in addition to the chain. `tree.sweeps` is the chain's own where this has the factors of
    the recursion."""

    tree: DerivativeWorkspace
    changes: ChainChanges
    slope: Real  # (nq+nu+1,) dy/dt there


def chain_jacobian(chain: Closed, nq: int, nu: int) -> ChainJacobian:
    """Make the workspace of `jacobian`; one per thread."""
    sweeps = chain.w if isinstance(chain.route, Recursion) else workspace(chain.c, nq, nu)
    return ChainJacobian(
        tree=DerivativeWorkspace(sweeps, tree_derivatives(chain.c, chain.cc, nq, nu)),
        changes=chain_changes(chain.cc, nu), slope=np.zeros(nq + nu + 1),
    )  # fmt: skip


@helper
def _as_they_are(route, t, y, s, w):
    return OK


@helper
def _factors_of_the_recursion(route, t, y, s, w):
    load_state(t, y, s.c, w)
    status = forward_dynamics(s.c, w)
    pose_sweep(s.c, w)
    for j in range(w.u.shape[0]):
        w.speed[j].acceleration = s.w.speed[j].acceleration
    return status


# (route, t, y, s, w): factors of the tree's mass matrix in w at y, with the accelerations in s.w; a status code.
factors = by_bundle(Recursion, _as_they_are, _factors_of_the_recursion)


@kernel
def jacobian(t, y, J, s, x):
    """J (n,n) = d(dy/dt)/dy at y = [q, u, work] (n,), row by row as `rhs` orders them; returns a status code.

    It holds for the constraint rows that s has chosen. Columns and rows of prescribed coordinates and speeds vanish.
    """
    status = slope(t, y, x.slope, s)
    if status == OK:
        status = factors(s.route, t, y, s, x.tree.sweeps)
    if status != OK:
        return status
    c, w, d = s.c, x.tree.sweeps, x.tree.tables
    differentiate(c, w, d, s.cc, s.cw, x.changes, has(c, PRESCRIBED), False)
    differentiate_power(c, w, d)
    solve(c, w, d, 2 * w.u.shape[0] + put_rows(d, s.cc, s.cw, x.changes))
    hold_rows(d, s.cc, s.cw, x.changes)
    if has(c, PRESCRIBED):
        _supply_drives(c, w, d, s.cc, s.cw, x.changes)
    store_jacobian(c, x.tree, J)
    return OK


@helper
def put_rows(d, cc, cw, x):
    """Put -J' of the chosen rows beside the columns by displacements and speeds; returns their number."""
    nu, count = d.speed.shape[0], 0
    for g in range(cc.group.shape[0]):
        first = cc.group[g].row_start
        for at in range(first, first + cw.rank[g]):
            row = x.jacobian[cw.chosen[at]]
            for place in range(nu):
                d.matrix[place, 2 * nu + count] = -row[place]
            count += 1
    return count


@sweep
def hold_rows(d, cc, cw, x):
    """Change the loads so that the rows keep their accelerations, and with them the accelerations; `solve` goes before.
    """
    for r in range(cw.row.shape[0]):
        for n in range(2 * d.speed.shape[0]):
            x.load[r, n] = 0.0
    _stop_changes(d, cc, cw, x)
    if is_delicate(cc, cw, DELICATE_CHANGES):
        _stop_changes(d, cc, cw, x)


@sweep
def _stop_changes(d, cc, cw, x):
    """Add to the changes of the loads, and of the accelerations, what the changes of the rows' accelerations need."""
    nu = d.speed.shape[0]
    for g in range(cc.group.shape[0]):
        first = cc.group[g].row_start
        for at in range(first, first + cw.rank[g]):
            r = cw.chosen[at]
            _opening(d, x, r, nu)
    for n in range(2 * nu):
        for g in range(cc.group.shape[0]):
            first = cc.group[g].row_start
            for at in range(first, first + cw.rank[g]):
                cw.scratch[at] = -x.opening[cw.chosen[at], n]
        solve_rows(cc, cw)
        for r in range(cw.row.shape[0]):
            x.opening[r, n] = cw.solution[r]
            x.load[r, n] += cw.solution[r]
    count = 0
    for g in range(cc.group.shape[0]):
        first = cc.group[g].row_start
        for at in range(first, first + cw.rank[g]):
            _add_response(d, x.opening[cw.chosen[at]], 2 * nu + count)
            count += 1


@helper
def _opening(d, x, r, nu):
    """J X + dg'' of row r, by displacements and speeds, to x.opening[r]."""
    out, J = x.opening[r], x.jacobian[r]
    for n in range(nu):
        out[n] = x.by_displacement[r, n]
        out[nu + n] = x.by_speed[r, n]
    for place in range(nu):
        if J[place] != 0.0:
            along, row = J[place], d.matrix[place]
            for n in range(2 * nu):
                out[n] += along * row[n]


@helper
def _add_response(d, load, column):
    """Add to the accelerations what the changes of one row's load do; the response to a unit load is in `column`."""
    nu = d.speed.shape[0]
    for place in range(nu):
        row = d.matrix[place]
        unit = row[column]
        if unit != 0.0:
            for n in range(2 * nu):
                row[n] += unit * load[n]


@helper
def _supply_drives(c, w, d, cc, cw, x):
    """Add to the change of the power what changes of accelerations and of the rows' loads do to that of drives."""
    nu = d.speed.shape[0]
    for place in range(nu):
        row, load = d.matrix[place], d.work[2 * nu + place]
        for n in range(2 * nu):
            d.work[n] += load * row[n]
        j = d.speed[place]
        if c.speed[j].prescribed >= 0:
            for r in range(cc.row.shape[0]):
                power = w.u[j] * x.jacobian[r, place]
                for n in range(2 * nu):
                    d.work[n] -= power * x.load[r, n]


@kernel
def move(y, increment, result, s):
    """Coordinates of result = those of y after motion for a unit of time at the constant speeds `increment` (nu,)."""
    retraction.move_by(y, increment, result, s.c)


@kernel
def resolve(y, u, x, how, s):
    """See `flexmb.motion.retraction`."""
    retraction.resolve_by(y, u, x, how, s.c)
