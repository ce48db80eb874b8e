"""Inverse dynamics tau = M udot + c of trees, O(N): Jain & Rodriguez (44), (45).

tau holds inertia, gravity, elasticity and node loads; hinge springs and motors are what it is compared with. Modal rows
vanish where the accelerations are consistent with an undriven structure.
"""

from flexmb.jain.accelerations import acceleration_sweep
from flexmb.jain.explicit import force_to_parent
from flexmb.jain.forces import elastic_forces, node_loads
from flexmb.jain.kinematics import add_force, motion_column, pose_sweep, velocity_sweep
from flexmb.jain.ports import port_acceleration, port_velocity
from flexmb.jit.kernel import helper
from flexmb.levels.body import body_inertia
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.spatial_vector import shift_force
from flexmb.spatial.vector import axpy, cross, dot, mat3, scale, store3, times, vec3


@helper
def inverse_dynamics(c, w, tau):
    """tau (nu,) for the state in w.q, w.u and the rates in w.speed.acceleration; w.body.load receives the loads."""
    velocity_sweep(c, w, False, False)
    if c.load.shape[0] > 0:
        pose_sweep(c, w)
    acceleration_sweep(c, w)
    for k in range(c.body.shape[0]):
        body_inertia(c, w, k)
        elastic_forces(c, w, k)
        node_loads(c, w, k)
        _inertial_force(c, w, k, tau)
    for k in range(c.body.shape[0] - 1, -1, -1):
        _project_force(c, w, k, tau)


@helper
def _inertial_force(c, w, k, tau):
    """f_m = M_m alpha_m + b_m (36), rigid part into w.body.force, modal part into w.mode.zf; wheels' rows into tau."""
    alpha, a = vec3(w.body[k].accel, 0), vec3(w.body[k].accel, 3)
    torque, force = inertia_times(load_inertia(w.body[k].inertia, 0), (alpha, a))
    for n in range(c.body[k].modes):
        coupling = w.mode[k, n].pfr
        torque = axpy(w.mode[k, n].etadd, vec3(coupling, 0), torque)
        force = axpy(w.mode[k, n].etadd, vec3(coupling, 3), force)
        s = w.mode[k, n].zf + dot(vec3(coupling, 0), alpha) + dot(vec3(coupling, 3), a)
        for i in range(c.body[k].modes):
            s += w.pff[k, n, i] * w.mode[k, i].etadd
        w.mode[k, n].zf = s
    add_force(w, k, (torque, force))
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        port = c.wheel[i].port
        j = c.wheel[i].u_index
        axial = c.wheel[i].axial
        axis = times(mat3(w.port[port].R, 0), vec3(c.wheel[i].axis, 0))
        omega, _ = port_velocity(w, k, port)
        node, _ = port_acceleration(c, w, k, port)
        reaction = axpy(axial * w.speed[j].acceleration, axis, cross(omega, scale(axial * w.u[j], axis)))
        add_force(w, k, (reaction, (0.0, 0.0, 0.0)))
        for n in range(c.body[k].modes):
            w.mode[k, n].zf += dot(vec3(w.port_mode[port, n].W, 0), reaction)
        tau[j] = axial * (w.speed[j].acceleration + dot(axis, node))


@helper
def _project_force(c, w, k, tau):
    """tau = script-H f_m (41); f at O is the load across the hinge; pass it on to the parent (36)."""
    torque, force = vec3(w.body[k].force, 0), vec3(w.body[k].force, 3)
    i = c.body[k].outboard_port
    if i >= 0:
        torque, force = shift_force((torque, force), scale(-1.0, vec3(w.port[i].r, 0)))
    for n in range(c.body[k].modes):
        row = w.mode[k, n].zf
        if i >= 0:
            row -= dot(vec3(w.port_mode[i, n].W, 0), torque) + dot(vec3(w.port_mode[i, n].L, 0), force)
        tau[c.body[k].etad_index + n] = row
    for n in range(c.body[k].nv):
        angular, linear = motion_column(c, w, k, n)
        tau[c.body[k].u_index + n] = dot(angular, torque) + dot(linear, force)
    store3(w.body[k].load, 0, torque)
    store3(w.body[k].load, 3, force)
    if c.body[k].parent >= 0:
        force_to_parent(c, w, w, k, (torque, force))
