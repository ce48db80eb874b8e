"""Entry points of the compiled recursion: right-hand side, accelerations, inverse dynamics."""

from flexmb.jain import inverse
from flexmb.jain.balance import power
from flexmb.jain.kinematics import pose_sweep
from flexmb.jain.loads import drive_loads
from flexmb.jain.sweeps import forward_dynamics
from flexmb.jit.kernel import helper, kernel, written_out
from flexmb.motion.coordinates import load_state, store_slope
from flexmb.spatial.spatial_vector import store6, times6, vec6
from flexmb.spatial.vector import mat3
from flexmb.tables.status import OK


@kernel
def rhs(t, y, dy, c, w):
    """dy/dt of y = [q, u, work] at time t; returns a status code. `work` integrates the non-conservative power."""
    return slope(t, y, dy, c, w)


@written_out
def slope(t, y, dy, c, w):
    """`rhs` as a part of other kernels."""
    load_state(t, y, c, w)
    status = forward_dynamics(c, w)
    if status != OK:
        return status
    drive_loads(c, w)
    store_slope(c, w, power(c, w), dy)
    return OK


@kernel
def accelerations(t, y, c, w):
    """udot to w.speed.acceleration; returns a status code."""
    load_state(t, y, c, w)
    return forward_dynamics(c, w)


@kernel
def inverse_dynamics(t, y, rates, c, w, tau, loads):
    """tau (nu,) = M rates + c: inertia, gravity, elasticity and node loads.

    loads (N,6) receives the loads that the hinges then transmit, [torque; force] on the body about O, World axes.
    """
    load_state(t, y, c, w)
    for j in range(rates.shape[0]):
        w.speed[j].acceleration = rates[j]
    inverse.inverse_dynamics(c, w, tau)
    pose_sweep(c, w)
    world_loads(c, w, loads)


@helper
def world_loads(c, w, loads):
    """Write w.body.load of all bodies, turned to World axes, to loads (N,6)."""
    for k in range(c.body.shape[0]):
        R = mat3(w.body[k].pose_rotation, 0)
        store6(loads[k], 0, times6(R, vec6(w.body[k].load, 0)))
