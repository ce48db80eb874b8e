"""Entry points for constants that are duals: derivatives by parameters, and at once along directions of the state.

In every lane the constants hold dc/dp of one parameter (`flexmb.parameters.tables`), and the state takes the direction
dy/dp that is given; with dy = 0 the derivatives are those at a fixed state.
"""

from __future__ import annotations

import numpy as np

from flexmb.closure.couplings import relieve_drives
from flexmb.closure.dynamics import closure_loads, linearise
from flexmb.closure.rows import load_on_b
from flexmb.closure.tables import COUPLINGS, ClosureConstants
from flexmb.closure.tangent import ClosureTangentWorkspace, closure_tangent_workspace, evaluate_held
from flexmb.entry import articulated
from flexmb.entry.articulated import slope
from flexmb.entry.observation import Outputs, observe
from flexmb.entry.observed_tangent import OutputsTangent, outputs_tangent
from flexmb.entry.tangent import TangentWorkspace, tangent_workspace
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL, RATES, rate, seeded
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.wide_arrays import as_duals
from flexmb.parameters.tables import DualConstants
from flexmb.spatial.spatial_vector import store6, times6
from flexmb.spatial.vector import mat3
from flexmb.tables.arrays import Constants
from flexmb.tables.status import OK
from flexmb.typing import Real


@bundle
class Loads:
    """Loads in dual numbers."""

    numbers = DUAL

    tau: Real  # (nu,) of inverse dynamics
    hinges: Real  # (N,6) World axes
    closures: Real  # (C,6) on body_b about frame B, World axes


@bundle
class ChainRates:
    """Workspace of the derivatives of a closed chain."""

    w: TangentWorkspace
    cw: ClosureTangentWorkspace


def parameter_workspace(dual: DualConstants, c: Constants, nq: int, nu: int) -> TangentWorkspace:
    """The workspace of a block; one per thread. c: its constants without derivatives."""
    w = tangent_workspace(c, nq, nu)
    w.ground[:, 1:] = -dual.gravity[:, 1:]  # what is final in a workspace, because it does not move
    w.port["r"][..., 1:] = dual.port["position"][..., 1:] + dual.port["offset"][..., 1:]
    w.port["R"][..., 1:] = dual.port["frame"][..., 1:]
    return w


def chain_rates(w: TangentWorkspace, cc: ClosureConstants) -> ChainRates:
    """The workspace of a block of a closed chain; one per thread."""
    return ChainRates(w=w, cw=closure_tangent_workspace(cc))


def loads(c: Constants, closures: int) -> Loads:
    """Loads of a tree with so many closures."""
    shapes = (len(c.speed),), (len(c.body), 6), (closures, 6)
    return Loads(*(as_duals(np.zeros(shape)) for shape in shapes))


def dual_outputs(out: Outputs) -> OutputsTangent:
    """Outputs whose numbers are duals."""
    return outputs_tangent(out)


@kernel
def slopes(t, y, dy, out, c, w):
    """out (n,RATES): derivatives of dy/dt of y = [q, u, work] (n,) by the parameters and along dy (n,RATES); a status
    code."""
    take(t, y, dy, w)
    status = slope(w.time[0], w.state, w.slope, c, w)
    give(w.slope, out)
    return status


@kernel
def outputs(t, y, c, w, out):
    """Everything observable of the free motion at a fixed state with its derivatives, left in `out`; a status code."""
    hold(t, y, w)
    status = slope(w.time[0], w.state, w.slope, c, w)
    if status == OK:
        observe(c, w, out)
    return status


@kernel
def inverse(t, y, rates, c, w, x):
    """tau and hinge loads of inverse dynamics at a fixed state for rates (nu,) with their derivatives, left in x."""
    hold(t, y, w)
    articulated.inverse_dynamics(w.time[0], w.state, rates, c, w, x.tau, x.hinges)


@kernel
def closed_slopes(t, y, dy, out, s, c, cc, x):
    """As `slopes` for a closed chain s, which has the constants without derivatives. The accelerations of the rows stay
    zero whatever the parameters are."""
    take(t, y, dy, x.w)
    status = _closed(t, y, s, c, cc, x)
    give(x.w.slope, out)
    return status


@kernel
def closed_outputs(t, y, s, c, cc, x, out, loads):
    """As `outputs` for a closed chain; the loads of closures are left in loads.closures."""
    hold(t, y, x.w)
    status = _closed(t, y, s, c, cc, x)
    if status != OK:
        return status
    if has(cc, COUPLINGS):
        relieve_drives(c, x.w, cc, x.cw)
    for i in range(cc.closure.shape[0]):
        store6(loads.closures[i], 0, times6(mat3(x.cw.closure[i].world, 0), load_on_b(cc, x.cw, i)))
    observe(c, x.w, out)
    return OK


@helper
def _closed(t, y, s, c, cc, x):
    """Evaluate the chain under loads that keep the rows' accelerations; returns a status code."""
    status = linearise(t, y, s)
    if status == OK:
        status = closure_loads(s.w, s.cc, s.cw)
    x.w.fault[0] = s.w.fault[0]
    return evaluate_held(s, c, x.w, cc, x.cw) if status == OK else status


@helper
def hold(t, y, w):
    """Set time and state without derivatives."""
    w.time[0] = t
    for i in range(y.shape[0]):
        w.state[i] = y[i]


@helper
def take(t, y, dy, w):
    """Set time, and the state with its derivatives."""
    hold(t, y, w)
    for i in range(y.shape[0]):
        for lane in range(RATES):
            x = w.state[i]
            w.state[i] = x + dy[i, lane] * (seeded(x, lane) - x)


@helper
def give(x, out):
    """Write the derivatives of duals (n,) to out (n,RATES)."""
    for i in range(x.shape[0]):
        for lane in range(RATES):
            out[i, lane] = rate(x[i], lane)
