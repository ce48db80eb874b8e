"""Loads across hinges, at wheel bearings, and of drives, from the accelerations of the sweeps.

A load is the total load (constraint, spring and motor) on the outboard part, about the outboard hinge point O. Along a
free speed with an armature, it is the force of spring, damper and motor less what accelerates the armature.
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
from flexmb.tables.features import ARMATURES, PRESCRIBED, WHEELS


@helper
def hinge_loads(c, w):
    """Write the loads across all hinges, body axes, to w.body.load."""
    for k in range(c.body.shape[0]):
        hinge_load(c, w, k)


@helper
def hinge_load(c, w, k):
    """Write the load across hinge k, F = P_R A + z_R about O, body axes, to w.body[k].load.

    P_R and z_R contain all outboard bodies, so that no further sweep is needed.
    """
    P_R, z_R = about_hinge(c, w, k)
    A = hinge_acceleration(c, w, k)
    store6(w.body[k].load, 0, sum6(inertia_times(load_inertia(P_R, 0), A), vec6(z_R, 0)))


@helper
def drive_loads(c, w):
    """Write the load of the drive of every prescribed speed to w.speed.drive.

    It is H F, plus what accelerates the armature, less spring and damper.
    """
    if has(c, PRESCRIBED):
        for k in range(c.body.shape[0]):
            _drive_loads(c, w, k)


@helper
def _drive_loads(c, w, k):
    """Drive loads of the hinge and the wheels of body k."""
    for n in range(c.body[k].nv):
        j = c.body[k].u_index + n
        if c.speed[j].prescribed >= 0:
            hinge_load(c, w, k)
            w.speed[j].drive = dot6(motion_column(c, w, k, n), vec6(w.body[k].load, 0)) - w.speed[j].applied
            if has(c, ARMATURES):
                w.speed[j].drive += c.speed[j].armature * w.speed[j].acceleration
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
    """Load [torque; force] of bearing and motor on wheel i about its centre, body axes.

    It is the rate of the wheel's momentum, with the angular momentum h = J_t (w - q q.w) + I (thetad + q.w) q.
    Accelerations are relative to free fall, so that gravity needs no term of its own.
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
