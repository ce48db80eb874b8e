"""The functions that exported code consists of: they take states by address and length, tables as bundles.

Those of trees take constants and workspace, those of closed chains the chain, which holds both, and the loads of its
ends. Outputs are those at the state of which the rates were just evaluated.
"""

from flexmb.closure import dynamics
from flexmb.closure.forces import transmit
from flexmb.closure.projection import project_closed
from flexmb.closure.rows import load_on_b
from flexmb.entry.articulated import slope, world_loads
from flexmb.entry.observation import observe_bodies, observe_free_motion, observe_motion
from flexmb.jit.bundle import bundle
from flexmb.jit.objects import reals_at
from flexmb.motion.coordinates import put_back
from flexmb.spatial.vector import mat3, store3, times
from flexmb.tables.status import OK
from flexmb.typing import Real


@bundle
class EndLoads:
    """What closures exert."""

    loads: Real  # (C,6) [torque; force] on body_b about frame B, World axes


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
