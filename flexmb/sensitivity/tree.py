"""The equations of motion of a tree in dual numbers, for one block of directions of `flexmb.sensitivity.flow`."""

from __future__ import annotations

from flexmb.entry.articulated import slope
from flexmb.entry.observation import observe, sense_markers
from flexmb.entry.tangent import TangentWorkspace
from flexmb.jain import inverse
from flexmb.jit.bundle import bundle
from flexmb.jit.duals import DUAL
from flexmb.jit.kernel import kernel
from flexmb.motion.coordinates import load_state, put_back
from flexmb.tables.arrays import Constants
from flexmb.typing import Real


@bundle
class TreeBlock:
    """Constants and workspace of a block; both hold duals."""

    c: Constants
    w: TangentWorkspace


@bundle
class Inertial:
    """Inertial forces in dual numbers."""

    numbers = DUAL

    tau: Real  # (nu,)


@kernel
def motion(t, s):
    """The rate of s.w.state to s.w.slope; returns a status code."""
    return slope(t, s.w.state, s.w.slope, s.c, s.w)


@kernel
def manifold(t, s):
    """Project s.w.state: unit quaternions, prescribed coordinates and speeds as given."""
    put_back(t, s.w.state, s.c)


@kernel
def see(t, c, w, out):
    """Markers at w.state with the accelerations out.rates."""
    sense_markers(t, w.state, c, w, out)


@kernel
def observing(s, out):
    """Everything observable where `motion` was just evaluated."""
    observe(s.c, s.w, out)


@kernel
def inertia_forces(t, c, w, rates, x):
    """The forces of inverse dynamics at the coordinates of w.state, at rest, for given rates (nu,): x.tau (nu,)."""
    load_state(t, w.state, c, w)
    for j in range(rates.shape[0]):
        w.u[j] = 0.0
        w.speed[j].acceleration = rates[j]
    inverse.inverse_dynamics(c, w, x.tau)
