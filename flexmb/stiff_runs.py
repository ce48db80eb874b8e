"""Compiled runs of methods that linearise, as in `flexmb.propagate`; compiled when one of them is first asked for.

Jacobians are exact (`flexmb.tangent`) and need the constants with every body eliminated explicitly, `plain`; the
equations of motion may run with others, c.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexmb import coordinates, dynamics, retraction, tangent
from flexmb.integrate.exponential import exponential
from flexmb.integrate.generalised_alpha import generalised_alpha
from flexmb.integrate.radau5 import radau5
from flexmb.kernel import helper, kernel

if TYPE_CHECKING:
    from flexmb.methods import Settings
    from flexmb.system import System
    from flexmb.trajectory import Array


@helper
def rhs(t, y, dy, constants, workspace):
    return dynamics.rhs(t, y, dy, constants[0], workspace[0])


@helper
def jacobian(t, y, J, constants, workspace):
    return tangent.jacobian(t, y, J, constants[1], workspace[1])


@helper
def project(t, y, constants):
    coordinates.project(t, y, constants[0])


@helper
def move(y, increment, result, constants):
    retraction.move(y, increment, result, constants[0])


@kernel
def run_radau5(y, times, segment_ends, rtol, atol, controlled, max_steps, c, plain, w, tangent_w, out, counts):
    """See `flexmb.integrate.radau5.radau5`."""
    return radau5(
        rhs, jacobian, project, y, times, segment_ends, rtol, atol, controlled, max_steps,
        (c, plain), (w, tangent_w), out, counts,
    )  # fmt: skip


@kernel
def run_exponential(y, times, segment_ends, rtol, atol, controlled, max_steps, c, plain, w, tangent_w, out, counts):
    """See `flexmb.integrate.exponential.exponential`."""
    return exponential(
        rhs, jacobian, project, y, times, segment_ends, rtol, atol, controlled, max_steps,
        (c, plain), (w, tangent_w), out, counts,
    )  # fmt: skip


@kernel
def run_generalised_alpha(
    y, times, segment_ends, step, radius, nq, controlled, rtol, atol, max_steps, c, plain, w, tangent_w, out, counts
):
    """See `flexmb.integrate.generalised_alpha.generalised_alpha`."""
    return generalised_alpha(
        rhs, jacobian, move, project, y, times, segment_ends, step, radius, nq, controlled, rtol, atol, max_steps,
        (c, plain), (w, tangent_w), out, counts,
    )  # fmt: skip


def run(
    system: System, settings: Settings, y: Array, times: Array, ends: Array, w: Any, out: Array, counts: Any
) -> tuple[int, float]:
    """Integrate y (nq+nu+1,); w is the recursion's workspace. Returns status code, time of the last good state."""
    nq, controlled = system.nq, system.nq + system.nu
    tangent_w = tangent.tangent_workspace(system.constants, nq, system.nu)
    tables = system.recursion_constants, system.constants, w, tangent_w
    if settings.method == "generalised_alpha":
        return run_generalised_alpha(
            y, times, ends, settings.step, settings.radius, nq, controlled, settings.rtol, settings.atol,
            settings.max_steps, *tables, out, counts,
        )  # fmt: skip
    adaptive = run_radau5 if settings.method == "radau5" else run_exponential
    return adaptive(y, times, ends, settings.rtol, settings.atol, controlled, settings.max_steps, *tables, out, counts)
