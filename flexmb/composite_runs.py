"""Compiled runs by composite bodies: integrators applied to them, as in `flexmb.propagate`."""

from __future__ import annotations

from flexmb.composite import rhs
from flexmb.coordinates import project
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
