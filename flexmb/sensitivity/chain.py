"""The equations of motion of a closed chain in dual numbers, for one block of directions.

The loads of closures follow from the implicit function theorem, `flexmb.closure.tangent.evaluate_held`.
"""

from __future__ import annotations

from flexmb.closure.couplings import relieve_drives
from flexmb.closure.dynamics import slope
from flexmb.closure.projection import project_closed
from flexmb.closure.rows import load_on_b
from flexmb.closure.tables import COUPLINGS, Closed, ClosureConstants
from flexmb.closure.tangent import evaluate, evaluate_held
from flexmb.entry.observation import observe
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.motion.coordinates import put_back
from flexmb.parameters.kernels import ChainRates
from flexmb.spatial.spatial_vector import store6, times6
from flexmb.spatial.vector import mat3
from flexmb.tables.arrays import Constants
from flexmb.tables.status import OK
from flexmb.typing import Index, Real


@bundle
class ClosureLoads:
    """Loads of closures in dual numbers."""

    numbers = DUAL

    every: Real  # (C,6) on body_b about frame B, World axes


@bundle
class ChainBlock:
    """A chain of floats, and constants and workspace of a block in duals.

    driven (F,): functions of time that controllers drive, in duals; the chain takes their values.
    """

    chain: Closed
    c: Constants
    cc: ClosureConstants
    x: ChainRates
    driven: Index
    y: Real  # (nq+nu+1,) the state without derivatives, and its rate
    slope: Real


@kernel
def motion(t, s):
    """The rate of s.x.w.state to s.x.w.slope; returns a status code."""
    x, w = s.x, s.x.w
    for i in range(s.y.shape[0]):
        s.y[i] = w.state[i].real
    w.time[0] = t
    for i in range(s.driven.shape[0]):
        f = s.driven[i]
        s.chain.c.function[f].data[0] = s.c.function[f].data[0].real
    status = slope(t, s.y, s.slope, s.chain)
    return evaluate_held(s.chain, s.c, w, s.cc, x.cw) if status == OK else status


@kernel
def manifold(t, s):
    """Project s.x.w.state; its derivatives, which are tangent to the closures, stay as they are but for quaternions and
    prescribed coordinates."""
    w = s.x.w
    put_back(t, w.state, s.c)
    for i in range(s.y.shape[0]):
        s.y[i] = w.state[i].real
    project_closed(t, s.y, s.chain)
    for i in range(s.y.shape[0]):
        _move(w.state, i, s.y[i])


@helper
def _move(state, i, value):
    """Set the value of a dual and keep its derivatives."""
    state[i] = state[i] + (value - state[i].real)


@kernel
def under_loads(t, s, load):
    """Accelerations, drive loads and row rates at s.x.w.state under given row loads (G,); returns a status code."""
    s.x.w.time[0] = t
    for r in range(load.shape[0]):
        s.x.cw.row[r].load = load[r]
    return evaluate(s.c, s.x.w, s.cc, s.x.cw)


@kernel
def observing(s, out):
    """Everything observable where `motion` was just evaluated, but for the loads of closures."""
    if has(s.cc, COUPLINGS):
        relieve_drives(s.c, s.x.w, s.cc, s.x.cw)
    observe(s.c, s.x.w, out)


@kernel
def closure_loads(s, loads):
    """The loads of closures where `motion` was just evaluated."""
    for i in range(s.cc.closure.shape[0]):
        store6(loads.every[i], 0, times6(mat3(s.x.cw.closure[i].world, 0), load_on_b(s.cc, s.x.cw, i)))
