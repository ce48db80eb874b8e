"""Accelerations of the bodies from base to tip, Jain & Rodriguez (24), for known accelerations of hinges and modes.

Accelerations are classical, of the point O, in body axes. Those in the workspace are relative to free fall (gravity is
subtracted). An argument x holds the accelerations: the workspace w itself, or a response to forces.
"""

from flexmb.jain.kinematics import motion_column
from flexmb.jain.ports import moved_by_modes
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.spatial_vector import axpy6, shift_motion, store6, sub6, sum6, times6_t, vec6
from flexmb.spatial.vector import cross, mat3, sub, times_t, vec3
from flexmb.tables.features import INBOARD_NODES, MODES, OUTBOARD_NODES


@sweep
def acceleration_sweep(c, w):
    """Accelerations of all bodies for given udot in w.speed.acceleration (24): the outward half of inverse dynamics."""
    for k in range(c.body.shape[0]):
        A = sum6(inboard_acceleration(c, w, k), vec6(w.body[k].bias, 0))
        for n in range(c.body[k].nv):
            A = axpy6(w.speed[c.body[k].u_index + n].acceleration, motion_column(c, w, k, n), A)
        if has(c, MODES):
            for n in range(c.body[k].modes):
                w.etadd[k, n] = w.speed[c.body[k].etad_index + n].acceleration
        store_body_acceleration(c, w, k, A)


@helper
def inboard_acceleration(c, w, k):
    """Acceleration of O as a point of the parent, without bias terms, minus gravity, in body axes: Phi' alpha_m."""
    return carried_acceleration(c, w, w, k)


@helper
def carried_acceleration(c, w, x, k):
    """Phi' alpha_m for the accelerations in x."""
    p = c.body[k].parent
    R = mat3(w.body[k].rotation, 0)
    if p < 0:
        return (0.0, 0.0, 0.0), times_t(R, vec3(x.ground, 0))
    A_parent = vec6(x.body[p].accel, 0)
    if has(c, INBOARD_NODES):
        i = c.body[k].inboard_port
        if i >= 0:
            A_parent = sum6(shift_motion(A_parent, vec3(w.port[i].r, 0)), moved_by_modes(c, w, x, p, i))
    return times6_t(R, shift_motion(A_parent, vec3(w.body[k].arm, 0)))


@helper
def store_body_acceleration(c, w, k, A):
    """Store the acceleration A of O, without the modal accelerations at O, and that of the body origin."""
    if has(c, OUTBOARD_NODES):
        store6(w.body[k].accel_hinge, 0, A)
    store_origin_acceleration(c, w, w, k, A)


@helper
def hinge_acceleration(c, w, k):
    """The stored acceleration of O; where no body has its hinge on a deforming node, O is the body origin."""
    return vec6(w.body[k].accel_hinge if has(c, OUTBOARD_NODES) else w.body[k].accel, 0)


@helper
def store_origin_acceleration(c, w, x, k, A):
    """Acceleration of the body origin into x, from A of O without the modal accelerations at O."""
    if has(c, OUTBOARD_NODES):
        i = c.body[k].outboard_port
        if i >= 0:
            A = sub6(A, moved_by_modes(c, w, x, k, i))
            A = A[0], sub(A[1], cross(A[0], vec3(w.port[i].r, 0)))
    store6(x.body[k].accel, 0, A)
