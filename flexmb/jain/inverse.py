"""Inverse dynamics tau = M udot + c of trees, O(N): Jain & Rodriguez (44), (45).

tau contains inertia, armatures, gravity, elasticity, node loads and connectors between nodes, but not the springs,
dampers and motors of hinges: tau is what these have to supply. Its modal rows vanish if the accelerations are a motion
that the structure performs without forces on its modes.
"""

from flexmb.jain.accelerations import acceleration_sweep
from flexmb.jain.connected import connect
from flexmb.jain.explicit import force_to_parent
from flexmb.jain.forces import add_port_torque, elastic_forces, node_loads
from flexmb.jain.kinematics import motion_column, pose_sweep, velocity_sweep
from flexmb.jain.ports import mode_motion, port_acceleration
from flexmb.jain.wheels import gyroscopic_torque, spin_axis
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.levels.body import body_inertia
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.spatial_vector import add6, axpy6, dot6, plus6, shift_force, store6, vec6
from flexmb.spatial.vector import axpy, dot, scale, vec3
from flexmb.tables.features import ARMATURES, CONNECTORS
from flexmb.tables.status import OK


@kernel
def inverse_dynamics(c, w, tau):
    """tau (nu,) for the state in w.q, w.u and the rates in w.speed.acceleration; hinge loads go to w.body.load.

    Returns the status code of the connectors.
    """
    velocity_sweep(c, w, False, False)
    if c.load.shape[0] > 0 or has(c, CONNECTORS):
        pose_sweep(c, w)
    acceleration_sweep(c, w)
    for k in range(c.body.shape[0]):
        body_inertia(c, w, k)
        elastic_forces(c, w, k)
        node_loads(c, w, k)
        _inertial_force(c, w, k, tau)
    # Connectors act on pairs of bodies: their loads are added when all bodies have forces, before any is passed inward.
    status = connect(c, w) if has(c, CONNECTORS) else OK
    for k in range(c.body.shape[0] - 1, -1, -1):
        _project_force(c, w, k, tau)
    return status


@helper
def _inertial_force(c, w, k, tau):
    """f_m = M_m alpha_m + b_m (36): rigid part to w.body.force, modal part to w.zf, rows of wheels to tau."""
    A = vec6(w.body[k].accel, 0)
    F = inertia_times(load_inertia(w.body[k].inertia, 0), A)
    for n in range(c.body[k].modes):
        M_fr = vec6(w.pfr[k, n], 0)
        F = axpy6(w.etadd[k, n], M_fr, F)
        row = plus6(w.zf[k, n], M_fr, A)
        for i in range(c.body[k].modes):
            row += w.pff[k, n, i] * w.etadd[k, i]
        w.zf[k, n] = row
    add6(w.body[k].force, 0, F)
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        port = c.wheel[i].port
        j = c.wheel[i].u_index
        axial, axis = c.wheel[i].axial, spin_axis(c, w, i)
        alpha, _ = port_acceleration(c, w, k, port)
        torque = axpy(axial * w.speed[j].acceleration, axis, gyroscopic_torque(c, w, k, i, axis))
        add_port_torque(c, w, w, k, port, torque)
        tau[j] = axial * (w.speed[j].acceleration + dot(axis, alpha))


@helper
def _project_force(c, w, k, tau):
    """tau = script-H f_m (41). The force F at O, which is the load across the hinge, is passed to the parent (36)."""
    F = vec6(w.body[k].force, 0)
    i = c.body[k].outboard_port
    if i >= 0:
        F = shift_force(F, scale(-1.0, vec3(w.port[i].r, 0)))
    for n in range(c.body[k].modes):
        row = w.zf[k, n]
        if i >= 0:
            row -= dot6(mode_motion(w, i, n), F)
        tau[c.body[k].etad_index + n] = row
    for n in range(c.body[k].nv):
        j = c.body[k].u_index + n
        tau[j] = dot6(motion_column(c, w, k, n), F)
        if has(c, ARMATURES):
            tau[j] += c.speed[j].armature * w.speed[j].acceleration
    store6(w.body[k].load, 0, F)
    if c.body[k].parent >= 0:
        force_to_parent(c, w, w, k, F)
