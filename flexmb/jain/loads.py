"""Loads across hinges, at wheel bearings, and of drives, from the accelerations the sweeps have found.

A load is the total one (constraint, spring and motor) on the outboard part, about the outboard hinge point O.
"""

from flexmb.jain.accelerations import hinge_acceleration
from flexmb.jain.explicit import about_hinge
from flexmb.jain.kinematics import motion_column
from flexmb.jain.ports import port_acceleration, port_velocity
from flexmb.jain.wheels import spin_axis
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.spatial_vector import dot6, store6, sum6, vec6
from flexmb.spatial.vector import add, axpy, cross, dot, scale, sub
from flexmb.tables.features import PRESCRIBED, WHEELS


@helper
def hinge_loads(c, w):
    """Loads across all hinges, body axes, into w.body.load."""
    for k in range(c.body.shape[0]):
        hinge_load(c, w, k)


@helper
def hinge_load(c, w, k):
    """F = P_R A + z_R at O of body k, body axes, into w.body[k].load."""
    P_R, z_R = about_hinge(c, w, k)
    A = hinge_acceleration(c, w, k)
    store6(w.body[k].load, 0, sum6(inertia_times(load_inertia(P_R, 0), A), vec6(z_R, 0)))


@helper
def drive_loads(c, w):
    """Generalised load of every prescribed speed, H F, beyond its spring and damper, into w.speed.drive."""
    if has(c, PRESCRIBED):
        for k in range(c.body.shape[0]):
            _drive_loads(c, w, k)


@helper
def _drive_loads(c, w, k):
    """Those of the speeds of hinge and wheels of body k."""
    for n in range(c.body[k].nv):
        j = c.body[k].u_index + n
        if c.speed[j].prescribed >= 0:
            hinge_load(c, w, k)
            w.speed[j].drive = dot6(motion_column(c, w, k, n), vec6(w.body[k].load, 0)) - w.speed[j].applied
    if has(c, WHEELS):
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j = c.wheel[i].u_index
            if c.speed[j].prescribed >= 0:
                axis = spin_axis(c, w, i)
                alpha, _ = port_acceleration(c, w, k, c.wheel[i].port)
                torque = c.wheel[i].axial * (w.speed[j].acceleration + dot(axis, alpha))
                w.speed[j].drive = torque - w.speed[j].applied


@helper
def wheel_load(c, w, k, i):
    """Load [tau; f] of the bearing and motor of wheel i on the wheel about its centre, body axes.

    Rate of its angular momentum h = J_t (w - q q.w) + I (thetad + q.w) q; gravity is in the acceleration.
    """
    port = c.wheel[i].port
    mass, axial, transverse = c.wheel[i].mass, c.wheel[i].axial, c.wheel[i].transverse
    axis = spin_axis(c, w, i)
    omega, _ = port_velocity(w, k, port)
    alpha, a = port_acceleration(c, w, k, port)
    j = c.wheel[i].u_index
    spin = w.u[j] + dot(axis, omega)
    spin_rate = w.speed[j].acceleration + dot(axis, alpha)
    across = sub(omega, scale(dot(axis, omega), axis))
    across_rate = sub(alpha, scale(dot(axis, alpha), axis))
    momentum = axpy(axial * spin, axis, scale(transverse, across))
    tau = add(axpy(axial * spin_rate, axis, scale(transverse, across_rate)), cross(omega, momentum))
    return tau, scale(mass, a)
