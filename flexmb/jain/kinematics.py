"""Outward sweep, base to tip: poses, velocities and the accelerations left when the speeds' rates vanish.

Jain & Rodriguez (10), (24), (25) for trees, in body axes. For hinges at deforming nodes on either side. Departure: the
accelerations are classical (of the hinge point), not spatial; the body order is base to tip.
"""

from flexmb.hinges import catalogue
from flexmb.jit.kernel import helper
from flexmb.levels.body import is_at_rest
from flexmb.levels.field import field_motion, second_order_motion
from flexmb.spatial.vector import (
    add,
    add3,
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


@helper
def velocity_sweep(c, w, shape, rates):
    """Poses, velocities and bias accelerations of all bodies and ports, base to tip (10), (11).

    `shape` and `rates` say whether a ruthless body shows its true eta and etadot or zero: neither in the equations of
    motion, the rates in kinetic energy and momentum (T = 1/2 u' M u), both for markers. What is at rest stays so.
    """
    displaced = shape or rates or w.displaced[0] != 0
    for k in range(c.body.shape[0]):
        exact = not is_at_rest(c.body[k].level)
        if exact or displaced:
            for n in range(c.body[k].modes):
                w.mode[k, n].eta = w.q[c.body[k].eta_index + n] if exact or shape else 0.0
                w.mode[k, n].etad = w.u[c.body[k].etad_index + n] if exact or rates else 0.0
            for i in range(c.body[k].port_start, c.body[k].port_stop):
                _move_port(c, w, k, i)
        _cross_hinge(c, w, k)
    w.displaced[0] = 1 if shape or rates else 0


@helper
def _move_port(c, w, k, i):
    """Pose and relative motion of port i of body k."""
    if c.body[k].modes == 0:
        return  # set once in the workspace
    x = vec3(c.port[i].position, 0)
    offset = vec3(c.port[i].offset, 0)
    row = c.port[i].second
    if row >= 0:
        r, R, w_rel, v_rel, alpha, a = second_order_motion(
            x, offset, c.port_mode[i], c.second_shape[row], w.mode[k], c.body[k].modes, w.port_mode[i]
        )
    else:
        r, R, w_rel, v_rel, alpha, a = field_motion(
            x, offset, c.port_mode[i], w.mode[k], c.body[k].modes, w.port_mode[i]
        )
    store3(w.port[i].r, 0, r)
    store9(w.port[i].R, 0, matmul(R, mat3(c.port[i].frame, 0)))
    store3(w.port[i].v, 0, w_rel)
    store3(w.port[i].v, 3, v_rel)
    store3(w.port[i].a, 0, alpha)
    store3(w.port[i].a, 3, a)


@helper
def port_velocity(w, k, i):
    """Velocity (w, v) of port i of body k, body axes (5)."""
    omega = vec3(w.body[k].velocity, 0)
    v = add(vec3(w.body[k].velocity, 3), cross(omega, vec3(w.port[i].r, 0)))
    return add(omega, vec3(w.port[i].v, 0)), add(v, vec3(w.port[i].v, 3))


@helper
def port_bias(w, k, i):
    """Acceleration (alpha, a) of port i at zero acceleration of the body origin and etaddot = 0, body axes."""
    omega = vec3(w.body[k].velocity, 0)
    w_rel = vec3(w.port[i].v, 0)
    inner = add(cross(omega, vec3(w.port[i].r, 0)), scale(2.0, vec3(w.port[i].v, 3)))
    return add(vec3(w.port[i].a, 0), cross(omega, w_rel)), add(vec3(w.port[i].a, 3), cross(omega, inner))


@helper
def port_acceleration(c, w, k, i):
    """Acceleration (alpha, a) of port i, minus gravity, body axes."""
    alpha, a = port_bias(w, k, i)
    body = vec3(w.body[k].accel, 0)
    alpha = add(alpha, body)
    a = add(a, add(vec3(w.body[k].accel, 3), cross(body, vec3(w.port[i].r, 0))))
    for n in range(c.body[k].modes):
        alpha = add(alpha, scale(w.mode[k, n].etadd, vec3(w.port_mode[i, n].W, 0)))
        a = add(a, scale(w.mode[k, n].etadd, vec3(w.port_mode[i, n].L, 0)))
    return alpha, a


@helper
def _inboard(c, w, k):
    """O+ of body k in parent axes (7): (w, v, alpha, a) of the parent's reference, arm from it to O+, R_parent_O+."""
    p = c.body[k].parent
    i = c.body[k].inboard_port
    zero = (0.0, 0.0, 0.0)
    if i >= 0:
        omega, v = port_velocity(w, p, i)
        alpha, a = port_bias(w, p, i)
        return omega, v, alpha, a, zero, mat3(w.port[i].R, 0)
    arm = vec3(c.body[k].placement_position, 0)
    R = mat3(c.body[k].placement_rotation, 0)
    if p < 0:
        return zero, zero, zero, zero, arm, R
    return vec3(w.body[p].velocity, 0), vec3(w.body[p].velocity, 3), zero, zero, arm, R


@helper
def _cross_hinge(c, w, k):
    """Velocity and bias of body k from its parent through the hinge (8), (9), (25)."""
    omega, v, alpha, a, arm, R_inboard = _inboard(c, w, k)
    i, j, kind = c.body[k].q_index, c.body[k].u_index, c.body[k].hinge_kind
    R_hinge, p_hinge = catalogue.pose(kind, w.q, i, c.body[k].sequence)
    V_rel, A_rel = catalogue.motion(kind, w.q, i, w.u, j, c.body[k].sequence, w.body[k].hinge_map)
    (w_rel, v_rel), (alpha_rel, a_rel) = V_rel, A_rel
    arm = add(arm, times(R_inboard, p_hinge))
    R = matmul(R_inboard, R_hinge)
    # O as a point of the parent, in outboard axes
    v = times_t(R, add(v, cross(omega, arm)))
    a = times_t(R, add(a, add(cross(alpha, arm), cross(omega, cross(omega, arm)))))
    omega = times_t(R, omega)
    alpha = times_t(R, alpha)
    # across the hinge
    alpha = add(add(alpha, cross(omega, w_rel)), alpha_rel)
    a = add(add(a, scale(2.0, cross(omega, v_rel))), a_rel)
    omega = add(omega, w_rel)
    v = add(v, v_rel)
    store3(w.body[k].arm, 0, arm)
    if c.body[k].outboard_port >= 0:
        R, omega, v, alpha, a = _from_deforming_node(c, w, k, R, omega, v, alpha, a)
    store9(w.body[k].rotation, 0, R)
    store3(w.body[k].velocity, 0, omega)
    store3(w.body[k].velocity, 3, v)
    store3(w.body[k].bias, 0, alpha)
    store3(w.body[k].bias, 3, a)


@helper
def _from_deforming_node(c, w, k, R, omega, v, alpha, a):
    """From O to the modal frame where O sits on a node d that moves in it: (9) with Pi_d, and its rate.

    The bias stays that of O, without what the deformation adds: the sweeps refer the body's inertia to O.
    """
    i = c.body[k].outboard_port
    R_body_O = mat3(w.port[i].R, 0)
    w_rel = vec3(w.port[i].v, 0)
    r = vec3(w.port[i].r, 0)
    omega = sub(times(R_body_O, omega), w_rel)
    v = sub(sub(times(R_body_O, v), cross(omega, r)), vec3(w.port[i].v, 3))
    store3(w.body[k].velocity, 0, omega)
    store3(w.body[k].velocity, 3, v)
    alpha_d, a_d = port_bias(w, k, i)
    for n in range(c.body[k].nv):
        H = w.body[k].hinge_map
        store_column(w.body[k].motion, n, times(R_body_O, column(H, n, 0)), times(R_body_O, column(H, n, 3)))
    return (
        matmul(R, transpose(R_body_O)),
        omega,
        v,
        sub(times(R_body_O, alpha), alpha_d),
        sub(times(R_body_O, a), a_d),
    )


@helper
def column(m, n, i):
    """Rows i, i+1, i+2 of column n."""
    return m[i, n], m[i + 1, n], m[i + 2, n]


@helper
def store_column(m, n, angular, linear):
    for i in range(3):
        m[i, n] = angular[i]
        m[3 + i, n] = linear[i]


@helper
def motion_column(c, w, k, n):
    """Column n of H in body axes as (angular, linear)."""
    if c.body[k].outboard_port >= 0:
        return column(w.body[k].motion, n, 0), column(w.body[k].motion, n, 3)
    return column(w.body[k].hinge_map, n, 0), column(w.body[k].hinge_map, n, 3)


@helper
def pose_sweep(c, w):
    """World poses of all body frames."""
    for k in range(c.body.shape[0]):
        p = c.body[k].parent
        i = c.body[k].inboard_port
        arm = vec3(w.body[k].arm, 0)
        R = mat3(w.body[k].rotation, 0)
        if p >= 0:
            R_parent = mat3(w.body[p].pose_rotation, 0)
            if i >= 0:
                arm = add(arm, vec3(w.port[i].r, 0))
            position = add(vec3(w.body[p].pose_position, 0), times(R_parent, arm))
            R = matmul(R_parent, R)
        else:
            position = arm
        if c.body[k].outboard_port >= 0:
            position = sub(position, times(R, vec3(w.port[c.body[k].outboard_port].r, 0)))
        store9(w.body[k].pose_rotation, 0, R)
        store3(w.body[k].pose_position, 0, position)


@helper
def acceleration_sweep(c, w):
    """Accelerations of all bodies for given udot in w.speed.acceleration (24): inverse dynamics, outward."""
    for k in range(c.body.shape[0]):
        alpha, a = inboard_acceleration(c, w, k)
        alpha = add(alpha, vec3(w.body[k].bias, 0))
        a = add(a, vec3(w.body[k].bias, 3))
        for n in range(c.body[k].nv):
            angular, linear = motion_column(c, w, k, n)
            rate = w.speed[c.body[k].u_index + n].acceleration
            alpha = add(alpha, scale(rate, angular))
            a = add(a, scale(rate, linear))
        for n in range(c.body[k].modes):
            w.mode[k, n].etadd = w.speed[c.body[k].etad_index + n].acceleration
        store_body_acceleration(c, w, k, (alpha, a))


@helper
def inboard_acceleration(c, w, k):
    """Acceleration of O as a point of the parent, without bias terms, minus gravity, in body axes: Phi' alpha_m."""
    return carried_acceleration(c, w, w, k)


@helper
def carried_acceleration(c, w, x, k):
    """Phi' alpha_m for the accelerations that x holds: the workspace w itself, or a response to forces."""
    p = c.body[k].parent
    R = mat3(w.body[k].rotation, 0)
    if p < 0:
        return (0.0, 0.0, 0.0), times_t(R, vec3(x.ground, 0))
    alpha = vec3(x.body[p].accel, 0)
    a = vec3(x.body[p].accel, 3)
    i = c.body[k].inboard_port
    if i >= 0:
        a = add(a, cross(alpha, vec3(w.port[i].r, 0)))
        for n in range(c.body[p].modes):
            alpha = add(alpha, scale(x.mode[p, n].etadd, vec3(w.port_mode[i, n].W, 0)))
            a = add(a, scale(x.mode[p, n].etadd, vec3(w.port_mode[i, n].L, 0)))
    return times_t(R, alpha), times_t(R, add(a, cross(alpha, vec3(w.body[k].arm, 0))))


@helper
def store_body_acceleration(c, w, k, A):
    """Keep the acceleration of O (without deformation part) and go on to the body origin."""
    alpha, a = A
    store3(w.body[k].accel_hinge, 0, alpha)
    store3(w.body[k].accel_hinge, 3, a)
    store_origin_acceleration(c, w, w, k, (alpha, a))


@helper
def store_origin_acceleration(c, w, x, k, A):
    """From the acceleration of O, without deformation part, to that of the body origin, kept in x."""
    alpha, a = A
    i = c.body[k].outboard_port
    if i >= 0:
        r = vec3(w.port[i].r, 0)
        for n in range(c.body[k].modes):
            alpha = sub(alpha, scale(x.mode[k, n].etadd, vec3(w.port_mode[i, n].W, 0)))
            a = sub(a, scale(x.mode[k, n].etadd, vec3(w.port_mode[i, n].L, 0)))
        a = sub(a, cross(alpha, r))
    store3(x.body[k].accel, 0, alpha)
    store3(x.body[k].accel, 3, a)


@helper
def add_force(w, k, F):
    """Add [tau; f] about the origin to the bias force of body k."""
    tau, f = F
    add3(w.body[k].force, 0, tau)
    add3(w.body[k].force, 3, f)
