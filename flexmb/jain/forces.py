"""What acts on the bodies besides inertia: elasticity, hinge springs and motors, loads at nodes, wheels."""

from flexmb.jain.kinematics import add_force
from flexmb.jain.ports import port_bias, port_velocity
from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import add_inertia, outer_inertia
from flexmb.spatial.vector import (
    axpy,
    cross,
    dot,
    mat3,
    scale,
    times,
    times_t,
    vec3,
)
from flexmb.tables.arrays import FORCE, NODE_AXES


@helper
def elastic_forces(c, w, k):
    """Add K eta + D etadot, at the true deformation for every level."""
    nm, q, u = c.body[k].modes, c.body[k].eta_index, c.body[k].etad_index
    if c.body[k].uncoupled:
        for n in range(nm):
            w.mode[k, n].zf += c.pair[k, n, n].stiffness * w.q[q + n] + c.pair[k, n, n].damping * w.u[u + n]
        return
    for n in range(nm):
        s = w.mode[k, n].zf
        for i in range(nm):
            s += c.pair[k, n, i].stiffness * w.q[q + i] + c.pair[k, n, i].damping * w.u[u + i]
        w.mode[k, n].zf = s


@helper
def load_vector(c, w, k, i):
    """Load i at its port in body axes: (port, tau, f)."""
    port = c.load[i].port
    magnitude = w.function[c.load[i].function, 0]
    direction = vec3(c.load[i].direction, 0)
    if c.load[i].frame == NODE_AXES:
        value = scale(magnitude, times(mat3(w.port[port].R, 0), direction))
    else:
        value = scale(magnitude, times_t(mat3(w.body[k].pose_rotation, 0), direction))
    if c.load[i].type == FORCE:
        return port, (0.0, 0.0, 0.0), value
    return port, value, (0.0, 0.0, 0.0)


@helper
def node_loads(c, w, k):
    """Subtract the loads at nodes from the bias force: A [tau; f] with A = [Pi'; phi] (14), (15)."""
    for i in range(c.body[k].load_start, c.body[k].load_stop):
        port, tau, f = load_vector(c, w, k, i)
        r = vec3(w.port[port].r, 0)
        add_force(w, k, (scale(-1.0, axpy(1.0, cross(r, f), tau)), scale(-1.0, f)))
        for n in range(c.body[k].modes):
            w.mode[k, n].zf -= dot(vec3(w.port_mode[port, n].W, 0), tau) + dot(vec3(w.port_mode[port, n].L, 0), f)


@helper
def wheel_forces(c, w, k):
    """Wheels of body k, eliminated: I (thetadd + q . alpha_node) = torque.

    The body holds the despun wheel. A free wheel takes the axial inertia away again (rank one) and hands its torque to
    the node; both add the gyroscopic torque w_node x I thetad q.
    """
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        port = c.wheel[i].port
        j = c.wheel[i].u_index
        axial = c.wheel[i].axial
        axis = times(mat3(w.port[port].R, 0), vec3(c.wheel[i].axis, 0))
        omega, _ = port_velocity(w, k, port)
        gyroscopic = cross(omega, scale(axial * w.u[j], axis))
        f = c.speed[j].prescribed
        if f >= 0:
            torque = axpy(axial * w.function[f, 2], axis, gyroscopic)
        else:
            alpha, _ = port_bias(w, k, port)
            torque = axpy(w.speed[j].applied - axial * dot(axis, alpha), axis, gyroscopic)
            _remove_axial_inertia(c, w, k, port, axis, axial)
        zero = (0.0, 0.0, 0.0)
        add_force(w, k, (torque, zero))
        for n in range(c.body[k].modes):
            w.mode[k, n].zf += dot(vec3(w.port_mode[port, n].W, 0), torque)


@helper
def _remove_axial_inertia(c, w, k, port, axis, axial):
    """M_m -= I a a' with a = [W' q; q; 0]."""
    zero = (0.0, 0.0, 0.0)
    add_inertia(w.body[k].inertia, 0, outer_inertia(axis, zero, -axial))
    nm = c.body[k].modes
    for n in range(nm):
        an = dot(vec3(w.port_mode[port, n].W, 0), axis)
        for i in range(3):
            w.mode[k, n].pfr[i] -= axial * an * axis[i]
        for i in range(nm):
            w.pff[k, n, i] -= axial * an * dot(vec3(w.port_mode[port, i].W, 0), axis)
