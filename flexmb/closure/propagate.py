"""Compiled runs of closed chains: the integrators applied to their right-hand side and projection."""

from flexmb.closure.dynamics import project, rhs
from flexmb.integrate.dop853 import dop853
from flexmb.integrate.rk4 import rk4
from flexmb.kernel import kernel


@kernel
def run_dop853(y, times, segment_ends, rtol, atol, controlled, max_steps, s, out, counts):
    """See `flexmb.integrate.dop853.dop853`."""
    return dop853(rhs, project, y, times, segment_ends, rtol, atol, controlled, max_steps, s, 0, out, counts)


@kernel
def run_rk4(y, times, segment_ends, step, max_steps, s, out, counts):
    """See `flexmb.integrate.rk4.rk4`."""
    return rk4(rhs, project, y, times, segment_ends, step, max_steps, s, 0, out, counts)


def dop853_run(y, times, segment_ends, rtol, atol, controlled, max_steps, _, s, out, counts):
    """`run_dop853` in the order of all routes: the constants are part of a closed chain."""
    return run_dop853(y, times, segment_ends, rtol, atol, controlled, max_steps, s, out, counts)


def rk4_run(y, times, segment_ends, step, max_steps, _, s, out, counts):
    """`run_rk4` likewise."""
    return run_rk4(y, times, segment_ends, step, max_steps, s, out, counts)
