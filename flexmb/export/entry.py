"""The functions that exported code consists of: they take states by address and length, tables as bundles.

Those of trees take constants and workspace, those of closed chains the chain, which holds both, and the loads of its
ends. Outputs are those at the state of which the rates were just evaluated.

Derivatives are those of implicit methods, J = d(dy/dt)/dy, and of everything observable along one direction of the
state, in which the accelerations change by J, and the loads of the rows of closures with them: a motion that is given
in dual numbers, as in `flexmb.system.linearisation`.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure import dynamics
from flexmb.closure import given_motion as given_chain
from flexmb.closure.forces import transmit
from flexmb.closure.given_motion import RowsTangent, rows_tangent
from flexmb.closure.jacobian import ChainJacobian, chain_jacobian
from flexmb.closure.jacobian import jacobian as differentiate_chain
from flexmb.closure.projection import project_closed
from flexmb.closure.rows import load_on_b
from flexmb.closure.tables import Closed
from flexmb.entry import given_motion as given_tree
from flexmb.entry.articulated import slope, world_loads
from flexmb.entry.derivatives import DerivativeWorkspace, by_coordinates, derivative_workspace
from flexmb.entry.derivatives import jacobian as differentiate_tree
from flexmb.entry.given_motion import MotionTangent, motion_tangent
from flexmb.entry.observation import Outputs, observe_bodies, observe_free_motion, observe_motion
from flexmb.entry.observed_tangent import OutputsTangent, outputs_tangent
from flexmb.entry.tangent import TangentWorkspace, tangent_workspace
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.objects import reals_at
from flexmb.motion.coordinates import put_back
from flexmb.spatial.vector import mat3, store3, times
from flexmb.tables.arrays import Constants
from flexmb.tables.features import PRESCRIBED
from flexmb.tables.status import OK
from flexmb.typing import Real


@bundle
class EndLoads:
    """What closures exert."""

    loads: Real  # (C,6) [torque; force] on body_b about frame B, World axes


@bundle
class TreeTangent:
    """What derivatives of a tree write. Its constants are those without reduced bodies, see `flexmb.entry.tangent`."""

    J: Real  # (n,n) d(dy/dt)/dy of y (n,) = [q, u, work]
    direction: Real  # (n,) of y, set by the caller
    rates: Real  # (nu,) udot
    c: Constants
    w: DerivativeWorkspace
    motion: MotionTangent
    duals: TangentWorkspace
    out: OutputsTangent


@bundle
class ChainTangent:
    """The same of a closed chain, beside the chain itself."""

    J: Real  # (n,n)
    direction: Real  # (n,)
    rates: Real  # (nu,)
    loads: Real  # (G,) of the rows
    by_state: Real  # (G,n) their derivatives by y
    w: ChainJacobian
    motion: MotionTangent
    duals: TangentWorkspace
    rows: RowsTangent
    out: OutputsTangent


def tree_tangent(c: Constants, nq: int, nu: int, out: Outputs) -> TreeTangent:
    """For outputs like `out`."""
    n = nq + nu + 1
    return TreeTangent(
        np.zeros((n, n)), np.zeros(n), np.zeros(nu), c, derivative_workspace(c, nq, nu), motion_tangent(nq, nu),
        tangent_workspace(c, nq, nu), outputs_tangent(out),
    )  # fmt: skip


def chain_tangent(s: Closed, nq: int, nu: int, out: Outputs) -> ChainTangent:
    """For outputs like `out`."""
    n, rows = nq + nu + 1, len(s.cc.row)
    return ChainTangent(
        np.zeros((n, n)), np.zeros(n), np.zeros(nu), np.zeros(rows), np.zeros((rows, n)), chain_jacobian(s, nq, nu),
        motion_tangent(nq, nu), tangent_workspace(s.c, nq, nu), rows_tangent(s.cc, s.c), outputs_tangent(out),
    )  # fmt: skip


def rates(t, y, dy, count, c, w):
    """dy/dt to dy (count,) of the state y (count,) = [q, u, work] at time t (s); returns a status code."""
    return slope(t, reals_at(y, count), reals_at(dy, count), c, w)


def outputs(t, y, count, c, w, out):
    """Everything observable to the arrays of `out`."""
    observe_free_motion(c, w, out)
    observe_bodies(c, w, out)
    return OK


def settle(t, y, count, c):
    """Give quaternions in y (count,) unit length, prescribed coordinates and speeds the values of their functions."""
    put_back(t, reals_at(y, count), c)
    return OK


def chain_rates(t, y, dy, count, s, ends):
    """`rates` of a closed chain, under the loads that keep the rows closed that were chosen last."""
    return dynamics.slope(t, reals_at(y, count), reals_at(dy, count), s)


def chain_outputs(t, y, count, s, ends, out):
    """`outputs` of a closed chain, with the loads of its closures."""
    transmit(s.route, s)
    world_loads(s.c, s.w, out.loads)
    for i in range(s.cc.closure.shape[0]):
        R = mat3(s.cw.closure[i].world, 0)
        tau, f = load_on_b(s.cc, s.cw, i)
        store3(ends.loads[i], 0, times(R, tau))
        store3(ends.loads[i], 3, times(R, f))
    for j in range(out.rates.shape[0]):
        out.rates[j] = s.w.speed[j].acceleration
        out.drives[j] = s.w.speed[j].drive
    observe_motion(t, reals_at(y, count), s.c, s.w, out)
    return OK


def chain_settle(t, y, count, s):
    """`settle`, and the nearest state that closes the chain, which is the last good one for the steps after it."""
    project_closed(t, reals_at(y, count), s)
    return s.cw.failure[0]


def derivatives(t, y, count, c, x):
    """x.J and x.rates at the state y (count,); returns a status code."""
    status = differentiate_tree(t, reals_at(y, count), x.J, c, x.w)
    for j in range(x.rates.shape[0]):
        x.rates[j] = x.w.sweeps.speed[j].acceleration
    return status


def chain_derivatives(t, y, count, s, x):
    """`derivatives` of a closed chain, and the loads of its rows with their derivatives."""
    status = differentiate_chain(t, reals_at(y, count), x.J, s, x.w)
    for j in range(x.rates.shape[0]):
        x.rates[j] = x.w.tree.sweeps.speed[j].acceleration
    for r in range(x.loads.shape[0]):
        x.loads[r] = s.cw.row[r].load
        by_coordinates(s.c, x.w.tree, x.w.changes.load[r], x.by_state[r], count - x.rates.shape[0] - 1)
    return status


def outputs_along(t, y, count, c, x):
    """Derivatives of everything observable along x.direction at the state y (count,) of which `derivatives` was called
    last, to the first derivative of the numbers in x.out; returns a status code."""
    _move(t, reals_at(y, count), c, x)
    return given_tree.observe_given(x.motion, c, x.duals, x.out)


def chain_outputs_along(t, y, count, s, x):
    """`outputs_along` of a closed chain; the loads of closures are in x.rows."""
    _move(t, reals_at(y, count), s.c, x)
    for r in range(x.loads.shape[0]):
        change = 0.0
        for i in range(count):
            change += x.by_state[r, i] * x.direction[i]
        x.rows.row[r].load = x.loads[r]
        x.rows.row[r].load = _moved(x.rows.row[r].load, change)
    return given_chain.observe_given(x.motion, s.c, x.duals, s.cc, x.rows, x.out)


@helper
def _move(t, y, c, x):
    """Set x.motion to the motion at y with its change along x.direction; what is prescribed does not change."""
    nu = x.rates.shape[0]
    nq = y.shape[0] - nu - 1
    if has(c, PRESCRIBED):
        for j in range(nu):
            if c.speed[j].prescribed >= 0:
                x.direction[c.speed[j].coordinate] = x.direction[nq + j] = 0.0
    x.motion.time[0] = t
    for i in range(y.shape[0]):
        x.motion.state[i] = y[i]
        x.motion.state[i] = _moved(x.motion.state[i], x.direction[i])
    for j in range(nu):
        change = 0.0
        for i in range(y.shape[0]):
            change += x.J[nq + j, i] * x.direction[i]
        x.motion.rates[j] = x.rates[j]
        x.motion.rates[j] = _moved(x.motion.rates[j], change)


@helper
def _moved(number, change):
    """A dual number with this first derivative."""
    return number + change * (seeded(number, 0) - number)
