"""Relative motion of contiguous bodies, base to tip: (78), (79), (116)-(132), and the entries of S = (126) (133).

The hinge point of the paper is the origin of a body's frame. Extensions beyond the paper change S only: hinges may
translate, hinges may be offset from their nodes, and the modes of a body may move its hinge point against its frame
(free-free modes). The motion of node frames is exact: displacement by the translation shapes, rotation by the
exponential of the rotation shapes. As printed, (118), (121), (124), they move by constant shapes.
"""

from flexmb.frisch.tables import FIXED_SHAPES
from flexmb.hinges import catalogue
from flexmb.jit.kernel import helper
from flexmb.levels.body import is_at_rest
from flexmb.levels.field import field_motion
from flexmb.spatial.rows import column6, store_column6
from flexmb.spatial.spatial_vector import ZERO6, axpy6, shift_motion, store6, sum6, times6, vec6
from flexmb.spatial.vector import (
    add,
    axpy,
    cross,
    mat3,
    matmul,
    scale,
    store3,
    store9,
    sub,
    times,
    transpose,
    vec3,
)


@helper
def relative_motion(c, w):
    """Poses, rates and kinematic biases of all bodies and ports, World axes, and the entries of S."""
    for k in range(c.body.shape[0]):
        seen = not is_at_rest(c.body[k].level)
        for n in range(c.body[k].modes):
            w.modal[k, n] = w.q[c.body[k].eta_index + n] if seen else 0.0
            w.modal_rate[k, n] = w.u[c.body[k].etad_index + n] if seen else 0.0
        for i in range(c.body[k].port_start, c.body[k].port_stop):
            _port_in_body(c, w, k, i)
        _across_hinge(c, w, k)
        for i in range(c.body[k].port_start, c.body[k].port_stop):
            _port_in_world(c, w, k, i)


@helper
def _port_in_body(c, w, k, i):
    """Pose and motion of port i of body k, body axes: (2), (43), (44) and their derivatives."""
    nm = c.body[k].modes
    x, p = vec3(c.port[i].position, 0), vec3(c.port[i].offset, 0)
    r, R, w_rel, v_rel, alpha, a = field_motion(
        w, x, p, c.port_mode[i], w.modal[k], w.modal_rate[k], nm, w.port_mode[i]
    )
    V, A = (w_rel, v_rel), (alpha, a)
    if c.printed[FIXED_SHAPES] == 1:
        r, V = _by_constant_shapes(c, w, k, i)
        A = ZERO6
    store3(w.port[i].r, 0, r)
    store9(w.port[i].R, 0, matmul(R, mat3(c.port[i].frame, 0)))
    store6(w.port[i].v, 0, V)
    store6(w.port[i].a, 0, A)


@helper
def _by_constant_shapes(c, w, k, i):
    """Position of port i and its velocity relative to body k as printed, by constant shapes: (118), (121), (124)."""
    x, p = vec3(c.port[i].position, 0), vec3(c.port[i].offset, 0)
    r, V = add(x, p), ZERO6
    for n in range(c.body[k].modes):
        psi, phi = column6(c.port_mode[i], n)
        phi = add(phi, cross(psi, p))
        store_column6(w.port_mode[i], n, (psi, phi))
        r = axpy(w.modal[k, n], phi, r)
        V = axpy6(w.modal_rate[k, n], (psi, phi), V)
    return r, V


@helper
def _port_in_world(c, w, k, i):
    """Turn pose and motion of port i of body k to World axes, once the body's attitude is known."""
    R = mat3(w.nest[k].rotation, 0)
    port = w.port[i]
    store9(port.R, 0, matmul(R, mat3(port.R, 0)))
    store3(port.r, 0, times(R, vec3(port.r, 0)))
    store6(port.v, 0, times6(R, vec6(port.v, 0)))
    store6(port.a, 0, times6(R, vec6(port.a, 0)))
    for n in range(c.body[k].modes):
        store_column6(w.port_mode[i], n, times6(R, column6(w.port_mode[i], n)))


@helper
def _across_hinge(c, w, k):
    """Velocity (116), (117), (123) and bias (119), (125) of body k relative to its parent; its motion in World.

    V and A are the velocity and the acceleration at udot = 0 relative to the parent, [angular; linear], World axes.
    """
    p, o = c.body[k].parent, c.body[k].outboard_port
    R_parent, omega = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    if p >= 0:
        R_parent, omega = mat3(w.nest[p].rotation, 0), vec3(w.nest[p].omega, 0)
    r, R, V_node, A_node = _inboard_node(c, w, k, R_parent)
    kind, at_q, at_u = c.body[k].hinge_kind, c.body[k].q_index, c.body[k].u_index
    sequence, parameters = c.body[k].sequence, c.body[k].parameters
    R_hinge, translation = catalogue.pose(c, kind, w.q, at_q, sequence, parameters)
    (w_hinge, v_hinge), (alpha_hinge, a_hinge) = catalogue.motion(
        c, kind, w.q, at_q, w.u, at_u, sequence, parameters, w.nest[k].hinge_map
    )
    arm = times(R, translation)
    R = matmul(R, R_hinge)
    V_hinge, A_hinge = times6(R, (w_hinge, v_hinge)), times6(R, (alpha_hinge, a_hinge))
    beta, back = add(r, arm), (0.0, 0.0, 0.0)
    V, A = _carried(V_node, A_node, arm, V_hinge, A_hinge)
    _hinge_columns(c, w, k, R)
    if o >= 0:  # from O to the body frame, against which the modes move O; `back` leads from the body origin to O
        R = matmul(R, transpose(mat3(w.port[o].R, 0)))
        back = times(R, vec3(w.port[o].r, 0))
        beta = sub(beta, back)
        V, A = _carrier(V, A, back, times6(R, vec6(w.port[o].v, 0)), times6(R, vec6(w.port[o].a, 0)))
    _modal_columns(c, w, k, R, arm, back)
    nest, spin = w.nest[k], V[0]
    store9(nest.rotation, 0, R)
    store3(nest.beta, 0, beta)
    store3(nest.hinge_point, 0, back)
    store3(nest.omega, 0, add(omega, spin))
    store3(nest.spin_bias, 0, add(A[0], cross(omega, spin)))  # (119)
    store3(nest.beta_bias, 0, A[1])  # (125)
    _follow_parent(w, k, p, omega, beta, V[1])


@helper
def _inboard_node(c, w, k, R_parent):
    """Node of the parent that carries hinge k: position, attitude, velocity (124) and acceleration, World axes."""
    i = c.body[k].inboard_port
    if i >= 0:
        return vec3(w.port[i].r, 0), mat3(w.port[i].R, 0), vec6(w.port[i].v, 0), vec6(w.port[i].a, 0)
    r = times(R_parent, vec3(c.body[k].placement_position, 0))
    return r, matmul(R_parent, mat3(c.body[k].placement_rotation, 0)), ZERO6, ZERO6


@helper
def _carried(V, A, arm, V_rel, A_rel):
    """Composition: velocity and acceleration of a point at `arm` in a frame, (116), (123), (129).

    V, A are those of the frame, V_rel, A_rel those of the point relative to the frame.
    """
    omega, (w_rel, v_rel) = V[0], V_rel
    turning = add(cross(omega, add(cross(omega, arm), scale(2.0, v_rel))), A_rel[1])
    alpha = add(add(A[0], cross(omega, w_rel)), A_rel[0])  # (130)
    return sum6(shift_motion(V, arm), V_rel), (alpha, add(add(A[1], cross(A[0], arm)), turning))


@helper
def _carrier(V_point, A_point, arm, V_rel, A_rel):
    """The inverse of `_carried`: motion of the frame from that of its point at `arm`."""
    w_rel, v_rel = V_rel
    omega = sub(V_point[0], w_rel)
    alpha = sub(A_point[0], add(A_rel[0], cross(omega, w_rel)))
    v = sub(V_point[1], add(cross(omega, arm), v_rel))
    turning = cross(omega, add(cross(omega, arm), scale(2.0, v_rel)))
    return (omega, v), (alpha, sub(A_point[1], add(add(cross(alpha, arm), turning), A_rel[1])))


@helper
def _follow_parent(w, k, p, omega, beta, beta_rate):
    """Origin of body k, its velocity, and its acceleration at udot = 0, from those of the parent p."""
    nest = w.nest[k]
    origin, velocity, path = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    if p >= 0:
        origin, velocity, path = vec3(w.nest[p].origin, 0), vec3(w.nest[p].velocity, 0), vec3(w.nest[p].path, 0)
    store3(nest.origin, 0, add(origin, beta))  # (78), (79)
    store3(nest.velocity, 0, add(velocity, add(beta_rate, cross(omega, beta))))
    store3(nest.path, 0, add(path, cross(omega, add(cross(omega, beta), scale(2.0, beta_rate)))))  # the sum in (89)


@helper
def _hinge_columns(c, w, k, R):
    """Columns q of (133): the free coordinate vectors of hinge k, rotation (129) and translation (132) of O."""
    H = w.nest[k].hinge_map
    for n in range(c.body[k].nv):
        at = c.column[c.body[k].u_index + n].start
        store3(w.S, at, times(R, (H[0, n], H[1, n], H[2, n])))
        store3(w.S, at + 3, times(R, (H[3, n], H[4, n], H[5, n])))


@helper
def _modal_columns(c, w, k, R, arm, back):
    """Partitions phiR_H, phiT_H of (126) for hinge k, referred to the body origin; `back` leads from it to O."""
    for n in range(c.body[k].nv):
        at = c.column[c.body[k].u_index + n].start
        store3(w.S, at + 3, sub(vec3(w.S, at + 3), cross(vec3(w.S, at), back)))
    p, i, o = c.body[k].parent, c.body[k].inboard_port, c.body[k].outboard_port
    if i >= 0:
        for n in range(c.body[p].modes):
            at = c.column[c.body[p].etad_index + n].start + c.element[k].inboard_entry
            W, L = column6(w.port_mode[i], n)
            store3(w.S, at, W)
            store3(w.S, at + 3, add(L, cross(W, sub(arm, back))))
    for n in range(c.body[k].modes):
        start = c.column[c.body[k].etad_index + n].start
        w.S[start] = 1.0
        if o >= 0:
            at = start + c.element[k].outboard_entry
            W, L = times6(R, column6(w.port_mode[o], n))
            store3(w.S, at, scale(-1.0, W))
            store3(w.S, at + 3, sub(cross(W, back), L))
