"""Wheels: each adds one speed to its body and acts on the node that carries it.

The mass matrix of the body already contains the despun wheel, its mass and inertia as if it were fixed to the node.
"""

from flexmb.jain.forces import add_port_torque
from flexmb.jain.ports import port_acceleration, port_bias, port_velocity
from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import add_inertia, outer_inertia
from flexmb.spatial.rows import column3
from flexmb.spatial.vector import add3, axpy, cross, dot, mat3, scale, times, vec3


@helper
def spin_axis(c, w, i):
    """Axis q of wheel i, body axes."""
    return times(mat3(w.port[c.wheel[i].port].R, 0), vec3(c.wheel[i].axis, 0))


@helper
def gyroscopic_torque(c, w, k, i, axis):
    """w_node x I thetad q of wheel i on body k."""
    omega, _ = port_velocity(w, k, c.wheel[i].port)
    return cross(omega, scale(c.wheel[i].axial * w.u[c.wheel[i].u_index], axis))


@helper
def wheel_forces(c, w, k):
    """Elimination of the wheels of body k, whose equations are I (thetadd + q . alpha_node) = torque.

    A free wheel transmits its torque to the node but not its axial inertia, which is subtracted from the body again (a
    term of rank one). Free and prescribed wheels add the gyroscopic torque.
    """
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        port = c.wheel[i].port
        j = c.wheel[i].u_index
        axial, axis = c.wheel[i].axial, spin_axis(c, w, i)
        gyroscopic = gyroscopic_torque(c, w, k, i, axis)
        f = c.speed[j].prescribed
        if f >= 0:  # a driven wheel moves relative to the node as prescribed, so the body keeps its axial inertia
            torque = axpy(axial * w.function[f, 2], axis, gyroscopic)
        else:
            alpha, _ = port_bias(w, k, port)
            torque = axpy(w.speed[j].applied - axial * dot(axis, alpha), axis, gyroscopic)
            _remove_axial_inertia(c, w, k, port, axis, axial)
        add_port_torque(c, w, w, k, port, torque)


@helper
def wheel_acceleration(c, w, k, i):
    """Rate of wheel i from I (thetadd + q . alpha_node) = torque, or from its drive."""
    j = c.wheel[i].u_index
    f = c.speed[j].prescribed
    if f >= 0:
        w.speed[j].acceleration = w.function[f, 2]
        return
    alpha, _ = port_acceleration(c, w, k, c.wheel[i].port)
    w.speed[j].acceleration = w.speed[j].applied / c.wheel[i].axial - dot(spin_axis(c, w, i), alpha)


@helper
def _remove_axial_inertia(c, w, k, port, axis, axial):
    """M_m -= I a a' with a = [W' q; q; 0]."""
    zero = (0.0, 0.0, 0.0)
    add_inertia(w.body[k].inertia, 0, outer_inertia(axis, zero, -axial))
    nm = c.body[k].modes
    for n in range(nm):
        an = dot(column3(w.port_mode[port], 0, n), axis)
        add3(w.pfr[k, n], 0, scale(-axial * an, axis))
        for i in range(nm):
            w.pff[k, n, i] -= axial * an * dot(column3(w.port_mode[port], 0, i), axis)
