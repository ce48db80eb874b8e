"""Loads across hinges, at wheel bearings, and of drives, from the accelerations the sweeps have found.

Total load (constraint, spring and motor) on the outboard part, about the outboard hinge point O.
"""

from flexmb.jain.kinematics import motion_column
from flexmb.jain.ports import port_acceleration, port_velocity
from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.vector import add, axpy, cross, dot, mat3, scale, store3, sub, times, vec3


@helper
def hinge_loads(c, w):
    """f = P_R alpha + z_R at O of every body, body axes, into w.body.load."""
    for k in range(c.body.shape[0]):
        hinge_load(w, k)


@helper
def hinge_load(w, k):
    """Load across the hinge of body k into w.body[k].load."""
    p = load_inertia(w.body[k].hinge_inertia, 0)
    tau, f = inertia_times(p, (vec3(w.body[k].accel_hinge, 0), vec3(w.body[k].accel_hinge, 3)))
    store3(w.body[k].load, 0, add(tau, vec3(w.body[k].hinge_force, 0)))
    store3(w.body[k].load, 3, add(f, vec3(w.body[k].hinge_force, 3)))


@helper
def drive_loads(c, w):
    """Generalised load of every prescribed speed, H'f, beyond its spring and damper, into w.speed.drive."""
    for k in range(c.body.shape[0]):
        j = c.body[k].u_index
        for n in range(c.body[k].nv):
            if c.speed[j + n].prescribed >= 0:
                hinge_load(w, k)
                angular, linear = motion_column(c, w, k, n)
                load = dot(angular, vec3(w.body[k].load, 0)) + dot(linear, vec3(w.body[k].load, 3))
                w.speed[j + n].drive = load - w.speed[j + n].applied
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            j_wheel = c.wheel[i].u_index
            if c.speed[j_wheel].prescribed >= 0:
                port = c.wheel[i].port
                axis = times(mat3(w.port[port].R, 0), vec3(c.wheel[i].axis, 0))
                alpha, _ = port_acceleration(c, w, k, port)
                torque = c.wheel[i].axial * (w.speed[j_wheel].acceleration + dot(axis, alpha))
                w.speed[j_wheel].drive = torque - w.speed[j_wheel].applied


@helper
def wheel_load(c, w, k, i):
    """Load of the bearing and motor of wheel i on the wheel about its centre, body axes: (tau, f).

    Rate of its angular momentum h = J_t (w - q q.w) + I (thetad + q.w) q; gravity is in the acceleration.
    """
    port = c.wheel[i].port
    mass, axial, transverse = c.wheel[i].mass, c.wheel[i].axial, c.wheel[i].transverse
    axis = times(mat3(w.port[port].R, 0), vec3(c.wheel[i].axis, 0))
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
