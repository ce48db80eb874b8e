"""Outward: poses and motion of the bodies in World axes, and what a unit of each hinge speed does to all beyond.

A change at a source, a displacement or a change of speed, moves all bodies beyond rigidly. Three motions describe it,
in components of axes that move with the bodies: s0, the displacement; s1, the change of the velocity V; and s2, with
which the acceleration changes by s2 + s1 x V. In this form all three are the same for all bodies beyond. With the
velocity V0 and acceleration A0 of the hinge's inboard frame, a hinge speed with the motion J has

    displacement    s0 = J    s1 = V0 x J    s2 = A0 x J + V0 x (V0 x J)
    speed           s0 = 0    s1 = J         s2 = 2 V0 x J

and further terms where J changes with the hinge's own coordinates (`flexmb.jain.derivatives.hinges`).
"""

from flexmb.jain import axis
from flexmb.jain.derivatives.hinges import outboard_rotation, put_seed, put_turn, several
from flexmb.jain.derivatives.ports import move_frame, see_modes
from flexmb.jain.derivatives.tables import BY_ACCELERATION, BY_RATE, SPEED_BY_ACCELERATION
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.cross6 import motion_cross
from flexmb.spatial.rows import store_column6
from flexmb.spatial.spatial_vector import ZERO6, axpy6, scale6, shift_motion, store6, sum6, vec6
from flexmb.spatial.vector import add, cross, mat3, matmul, store3, store9, sub, times, vec3
from flexmb.tables.features import CONNECTORS, INBOARD_NODES, LOADS, MODES, OUTBOARD_NODES, SEVERAL, WHEELS


@helper
def move(c, w, d, k):
    """Pose and motion of body k and the seeds of its hinge, after those of its parent."""
    R, r, V0, A0 = _inboard(c, w, d, k)
    store9(d.body[k].rotation, 0, R)
    store3(d.body[k].position, 0, r)
    R_O = outboard_rotation(c, w, d, k)
    if has(c, SEVERAL) and not axis.has_axis(c, k):
        V, A = several(c, w, d, k, R_O, r, V0, A0)
    else:
        V, A = _single(c, w, d, k, R_O, r, V0, A0)
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        V, A = move_frame(c, w, d, k, R, r, V, A)
        r = sub(r, times(R, vec3(w.port[c.body[k].outboard_port].r, 0)))
    if has(c, MODES) or has(c, LOADS) or has(c, WHEELS) or has(c, CONNECTORS):
        store3(d.body[k].origin, 0, r)
    store6(d.body[k].velocity, 0, V)
    store6(d.body[k].accel, 0, A)


@helper
def _inboard(c, w, d, k):
    """R_World_body, the position of O, and the motion of the inboard frame, about the base point of body k."""
    p = c.body[k].parent
    R, arm = mat3(w.body[k].rotation, 0), vec3(w.body[k].arm, 0)
    if p < 0:
        return R, (0.0, 0.0, 0.0), ZERO6, (ZERO6[0], vec3(w.ground, 0))
    R_parent = mat3(d.body[p].rotation, 0)
    V0, A0 = vec6(d.body[p].velocity, 0), vec6(d.body[p].accel, 0)
    if has(c, INBOARD_NODES) and c.body[k].inboard_port >= 0:
        i = c.body[k].inboard_port
        r = vec3(d.port[i].position, 0)
        V0, A0 = vec6(d.port[i].velocity, 0), vec6(d.port[i].accel, 0)
    else:
        r = vec3(d.body[p].origin if has(c, MODES) else d.body[p].position, 0)
    r = add(r, times(R_parent, arm))
    R = matmul(R_parent, R)
    if d.places[k].new_point:
        store3(d.body[k].step, 0, r)
        V0, A0 = shift_motion(V0, r), shift_motion(A0, r)
        r = (0.0, 0.0, 0.0)
    if has(c, MODES) and d.places[k].sees > 0:
        see_modes(c, d, k)
    return R, r, V0, A0


@helper
def _single(c, w, d, k, R, r, V0, A0):
    """A hinge with a single axis, which is z of its axes."""
    z = (R[2], R[5], R[8])
    J = (z, cross(r, z)) if axis.turns(c, k) else (ZERO6[0], z)
    j, slot = c.body[k].u_index, d.places[k].slot
    turned = motion_cross(V0, J)
    store_column6(d.seed, slot, J)
    put_seed(d, BY_RATE, slot, turned)
    put_turn(c, d, slot, J)
    put_seed(d, BY_ACCELERATION, slot, sum6(motion_cross(A0, J), motion_cross(V0, turned)))
    put_seed(d, SPEED_BY_ACCELERATION, slot, scale6(2.0, turned))
    V = axpy6(w.u[j], J, V0)
    return V, axpy6(w.speed[j].acceleration, J, axpy6(w.u[j], turned, A0))
