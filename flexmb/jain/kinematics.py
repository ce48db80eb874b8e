"""Outward sweep, base to tip: poses, velocities and bias accelerations (those at zero rates of all speeds).

Jain & Rodriguez (10), (24), (25) for trees, in body axes, with hinges that may sit on deforming nodes of the inboard
and the outboard body. Departures: accelerations are classical ones of the hinge point O, and bodies are numbered from
base to tip.
"""

from flexmb.hinges import catalogue
from flexmb.jain import axis
from flexmb.jain.ports import move_port, port_bias, port_velocity
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.jit.strips import part, put, width
from flexmb.levels.body import is_at_rest
from flexmb.levels.section_motion import move_sections
from flexmb.spatial.spatial_vector import (
    ZERO6,
    shift_acceleration,
    shift_motion,
    store6,
    sub6,
    sum6,
    times6,
    times6_t,
    vec6,
)
from flexmb.spatial.vector import (
    add,
    cross,
    mat3,
    matmul,
    scale,
    store3,
    store9,
    sub,
    times,
    times_t,
    transpose,
    vec3,
)
from flexmb.tables.features import INBOARD_NODES, MODES, OUTBOARD_NODES, SECTIONS


@kernel
def velocity_sweep(c, w, shape, rates):
    """Poses, velocities and bias accelerations of all bodies and ports, base to tip (10), (11).

    Bodies of level ruthless move here with their true eta and etadot if `shape` and `rates` are True, and with zero
    otherwise: neither is used in the equations of motion (B1), the rates in kinetic energy and momentum, for which
    T = 1/2 u' M u must hold, and both for the positions and velocities of markers.

    w.displaced remembers whether the last sweep used them: if not, ruthless bodies are undeformed in the workspace
    already, and sweeps of the equations of motion leave them alone.
    """
    axis.turn(c, w)
    displaced = shape or rates or w.displaced[0] != 0
    for k in range(c.body.shape[0]):
        move_body(c, w, k, shape, rates, displaced)
    w.displaced[0] = 1 if shape or rates else 0


@helper
def move_body(c, w, k, shape, rates, displaced):
    """`velocity_sweep` for body k after its parent; `displaced`: ruthless bodies may not be undeformed in w."""
    if has(c, MODES):
        exact = not is_at_rest(c.body[k].level)
        if exact or displaced:
            modes = c.body[k].modes
            _take(w, w.eta[k], modes, exact or shape, w.q, c.body[k].eta_index)
            _take(w, w.etad[k], modes, exact or rates, w.u, c.body[k].etad_index)
            if has(c, SECTIONS) and c.body[k].section_stop > c.body[k].section_start:
                move_sections(c, w, k)
            for i in range(c.body[k].port_start, c.body[k].port_stop):
                move_port(c, w, k, i)
    _cross_hinge(c, w, k)


@helper
def _take(w, row, modes, shown, numbers, first):
    """Copy the numbers from `first` on to a row over modes, or zeros.

    They are written in strips because they are soon read in strips: a vector load of numbers that were just stored one
    by one waits until they have reached the cache.
    """
    for n in range(0, modes, width(w)):
        if shown:
            put(w, row, n, part(w, numbers, first, n, modes))
        else:
            put(w, row, n, 0.0)


@helper
def _cross_hinge(c, w, k):
    """Velocity and bias acceleration of body k from those of its parent, through the hinge (8), (9), (25)."""
    R, arm = _inboard(c, w, k)
    if axis.has_axis(c, k):
        R, arm = axis.pose(c, w, k, R, arm)
        V, A = _carried(c, w, k, R, arm)
        V, A = axis.cross_hinge(c, w, k, V, A)
    else:
        i, j, kind = c.body[k].q_index, c.body[k].u_index, c.body[k].hinge_kind
        sequence, parameters = c.body[k].sequence, c.body[k].parameters
        R_hinge, p_hinge = catalogue.pose(c, kind, w.q, i, sequence, parameters)
        V_rel, A_rel = catalogue.motion(c, kind, w.q, i, w.u, j, sequence, parameters, w.hinge[k].map)
        R, arm = matmul(R, R_hinge), add(arm, times(R, p_hinge))
        V, A = _carried(c, w, k, R, arm)
        # V_rel has its components in turning axes, hence w x w_rel and w x v_rel; the latter counts twice (Coriolis).
        coriolis = cross(V[0], V_rel[0]), scale(2.0, cross(V[0], V_rel[1]))
        V, A = sum6(V, V_rel), sum6(sum6(A, coriolis), A_rel)
    store3(w.body[k].arm, 0, arm)
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        R, V, A = _from_deforming_node(c, w, k, R, V, A)
    store9(w.body[k].rotation, 0, R)
    store6(w.body[k].velocity, 0, V)
    store6(w.body[k].bias, 0, A)


@helper
def _inboard(c, w, k):
    """R_parent_O+ of body k, and the arm to O+ from the parent's origin, or from the port if O+ sits on one."""
    if has(c, INBOARD_NODES):
        i = c.body[k].inboard_port
        if i >= 0:
            return mat3(w.port[i].R, 0), (0.0, 0.0, 0.0)
    return mat3(c.body[k].placement_rotation, 0), vec3(c.body[k].placement_position, 0)


@helper
def _carried(c, w, k, R, arm):
    """Velocity and bias of the point of the parent that coincides with O, in outboard axes (7); R = R_parent_O."""
    p = c.body[k].parent
    if p < 0:
        return ZERO6, ZERO6
    if has(c, INBOARD_NODES):
        i = c.body[k].inboard_port
        if i >= 0:
            V, A = port_velocity(w, p, i), port_bias(w, p, i)
            return times6_t(R, shift_motion(V, arm)), times6_t(R, shift_acceleration(A, V, arm))
    V = vec6(w.body[p].velocity, 0)
    return times6_t(R, shift_motion(V, arm)), (ZERO6[0], times_t(R, cross(V[0], cross(V[0], arm))))


@helper
def _from_deforming_node(c, w, k, R_parent_O, V_O, A_O):
    """Motion of the modal frame from that of O, where O sits on a node d that deforms: (9) with Pi_d, and its rate.

    The bias returned is that of O less `port_bias`. It is not shifted to the origin of the modal frame, because the
    sweeps refer the body's inertia to O.
    """
    i = c.body[k].outboard_port
    R_body_O = mat3(w.port[i].R, 0)
    w_rel, v_rel = vec6(w.port[i].v, 0)
    omega, v_O = times6(R_body_O, V_O)
    omega = sub(omega, w_rel)
    V = omega, sub(sub(v_O, cross(omega, vec3(w.port[i].r, 0))), v_rel)
    store6(w.body[k].velocity, 0, V)
    for n in range(c.body[k].nv):
        store_column(w.hinge[k].motion, n, times6(R_body_O, _own_column(c, w, k, n)))
    return matmul(R_parent_O, transpose(R_body_O)), V, sub6(times6(R_body_O, A_O), port_bias(w, k, i))


@helper
def column(H, n):
    """Column n of a matrix of motions."""
    return (H[0, n], H[1, n], H[2, n]), (H[3, n], H[4, n], H[5, n])


@helper
def store_column(H, n, V):
    for i in range(3):
        H[i, n] = V[0][i]
        H[3 + i, n] = V[1][i]


@helper
def motion_column(c, w, k, n):
    """Column n of H' in body axes: the velocity [angular; linear] of O at unit speed n of the hinge."""
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        return column(w.hinge[k].motion, n)
    return _own_column(c, w, k, n)


@helper
def _own_column(c, w, k, n):
    """Column n of H' in outboard axes."""
    if axis.has_axis(c, k):
        return axis.column(c, k)
    return column(w.hinge[k].map, n)


@sweep
def pose_sweep(c, w):
    """World poses of all body frames."""
    for k in range(c.body.shape[0]):
        pose_body(c, w, k)


@helper
def pose_body(c, w, k):
    """World pose of body k from that of its parent."""
    p = c.body[k].parent
    i = c.body[k].inboard_port
    arm = vec3(w.body[k].arm, 0)
    R = mat3(w.body[k].rotation, 0)
    if p >= 0:
        R_parent = mat3(w.body[p].pose_rotation, 0)
        if has(c, INBOARD_NODES) and i >= 0:
            arm = add(arm, vec3(w.port[i].r, 0))
        position = add(vec3(w.body[p].pose_position, 0), times(R_parent, arm))
        R = matmul(R_parent, R)
    else:
        position = arm
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        position = sub(position, times(R, vec3(w.port[c.body[k].outboard_port].r, 0)))
    store9(w.body[k].pose_rotation, 0, R)
    store3(w.body[k].pose_position, 0, position)
