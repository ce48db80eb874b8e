"""Everything observable of a motion whose accelerations are given, with derivatives along seven directions at once.

    x = motion_tangent(system.nq, system.nu)        values and directions of q, u, udot and t, set by the caller
    status = observe_given(x, system.constants, w, out)

Coordinates, speeds, accelerations and time are independent here: no equations of motion are solved. Loads are those of
inverse dynamics. How the accelerations of a free motion depend on the state is then a matter of the directions:
`flexmb.system.pushforward`.

w is made by `flexmb.entry.tangent.tangent_workspace`, out by `flexmb.entry.observed_tangent.outputs_tangent`.
"""

from __future__ import annotations

import numpy as np

from flexmb.entry.articulated import world_loads
from flexmb.entry.observation import observe_bodies
from flexmb.jain.accelerations import acceleration_sweep
from flexmb.jain.inverse import inverse_dynamics
from flexmb.jain.kinematics import pose_sweep, velocity_sweep
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.wide_arrays import as_duals
from flexmb.levels.body import AT_REST
from flexmb.motion.coordinates import hinge_forces, load_state
from flexmb.tables.status import OK
from flexmb.typing import Real


@bundle
class MotionTangent:
    """A motion at one instant, in dual numbers, and the tau that follows from it."""

    numbers = DUAL

    time: Real  # (1,) s
    state: Real  # (nq+nu+1,) y = [q, u, work]
    rates: Real  # (nu,) accelerations
    tau: Real  # (nu,) of inverse dynamics, written


def motion_tangent(nq: int, nu: int) -> MotionTangent:
    """All zero; one per thread."""
    return MotionTangent(
        time=as_duals(np.zeros(1)), state=as_duals(np.zeros(nq + nu + 1)), rates=as_duals(np.zeros(nu)),
        tau=as_duals(np.zeros(nu)),
    )  # fmt: skip


@kernel
def observe_given(x, c, w, out):
    """All outputs of the motion x to `out`, and tau to x.tau; returns a status code.

    w is left with the poses and motions of the bodies in the equations of motion: ruthless bodies are undeformed.
    """
    status = invert(x, c, w)
    if status != OK:
        return status
    world_loads(c, w, out.loads)
    for j in range(x.tau.shape[0]):
        out.drives[j] = x.tau[j] - w.speed[j].applied
    observe_others(x, c, w, out)
    return OK


@helper
def invert(x, c, w):
    """Inverse dynamics of the motion x: tau to x.tau, loads of hinges to w.body.load; returns a status code."""
    load_state(x.time[0], x.state, c, w)
    for j in range(x.rates.shape[0]):
        w.speed[j].acceleration = x.rates[j]
    hinge_forces(c, w)
    status = inverse_dynamics(c, w, x.tau)
    pose_sweep(c, w)
    return status


@helper
def observe_others(x, c, w, out):
    """What `invert` has not found: accelerations, markers, loads of wheels and connectors, energy and momentum."""
    for j in range(x.rates.shape[0]):
        out.rates[j] = x.rates[j]
    observe_bodies(c, w, out)
    if has(c, AT_REST):
        velocity_sweep(c, w, False, False)
        pose_sweep(c, w)
        acceleration_sweep(c, w)
