"""Compiled runs of closed chains: the integrators applied to their right-hand side and projection."""

from flexmb.closure.dynamics import project, rhs
from flexmb.integrate.dop853 import dop853
from flexmb.integrate.rk4 import rk4
from flexmb.kernel import kernel


@kernel
def run_dop853(y, times, segment_ends, rtol, atol, controlled, max_steps, c, w, cc, cw, out, counts):
    """See `flexmb.integrate.dop853.dop853`."""
    model = (c, w, cc, cw)
    return dop853(rhs, project, y, times, segment_ends, rtol, atol, controlled, max_steps, model, 0, out, counts)


@kernel
def run_rk4(y, times, segment_ends, step, max_steps, c, w, cc, cw, out, counts):
    """See `flexmb.integrate.rk4.rk4`."""
    model = (c, w, cc, cw)
    return rk4(rhs, project, y, times, segment_ends, step, max_steps, model, 0, out, counts)


def dop853_run(y, times, segment_ends, rtol, atol, controlled, max_steps, constants, workspace, out, counts):
    """`run_dop853` with the constants and the workspace of a closed chain as one argument each."""
    (c, cc), (w, cw) = constants, workspace
    return run_dop853(y, times, segment_ends, rtol, atol, controlled, max_steps, c, w, cc, cw, out, counts)


def rk4_run(y, times, segment_ends, step, max_steps, constants, workspace, out, counts):
    """`run_rk4` likewise."""
    (c, cc), (w, cw) = constants, workspace
    return run_rk4(y, times, segment_ends, step, max_steps, c, w, cc, cw, out, counts)
