"""Compiled runs: the integrators applied to the dynamics of a system. Here the two rooms meet; nothing else happens."""

from __future__ import annotations

from flexmb.coordinates import project
from flexmb.dynamics import rhs
from flexmb.integrate.dop853 import dop853
from flexmb.integrate.rk4 import rk4
from flexmb.kernel import kernel


@kernel
def run_dop853(y, times, segment_ends, rtol, atol, controlled, max_steps, constants, workspace, out, counts):
    """See `flexmb.integrate.dop853.dop853`."""
    return dop853(
        rhs, project, y, times, segment_ends, rtol, atol, controlled, max_steps, constants, workspace, out, counts
    )


@kernel
def run_rk4(y, times, segment_ends, step, max_steps, constants, workspace, out, counts):
    """See `flexmb.integrate.rk4.rk4`."""
    return rk4(rhs, project, y, times, segment_ends, step, max_steps, constants, workspace, out, counts)
