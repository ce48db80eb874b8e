"""What a closure suppresses: value, rate and acceleration of each row, from the motion of its two ports.

Relative motion of frame B seen from frame A, in A axes: R = R_A'R_B, p = R_A'(x_B - x_A), and their rates. A
translation row along axis i is p_i. A rotation row sets an axis a of A at right angles to an axis b of B, g = a . R b:

    about x: a = -y, b = z      about y: a = x, b = z      about z: a = -x, b = y,

so that near R = 1 the row is the component of the relative rotation about that axis. Its unit load is the torque
R b x a.
"""

from flexmb.closure.tables import ON_GROUND, ROTATION
from flexmb.jain.ports import port_acceleration, port_velocity
from flexmb.jit.kernel import helper
from flexmb.spatial.vector import (
    add,
    cross,
    dot,
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
def pose(w, side):
    """Position and rotation of a port in World. Needs the pose sweep."""
    if side.body == ON_GROUND:
        return vec3(side.position, 0), mat3(side.rotation, 0)
    R = mat3(w.body[side.body].pose_rotation, 0)
    position = add(vec3(w.body[side.body].pose_position, 0), times(R, vec3(w.port[side.port].r, 0)))
    return position, matmul(R, mat3(w.port[side.port].R, 0))


@helper
def velocity(w, side):
    """Angular and linear velocity of a port, World axes."""
    if side.body == ON_GROUND:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    R = mat3(w.body[side.body].pose_rotation, 0)
    omega, v = port_velocity(w, side.body, side.port)
    return times(R, omega), times(R, v)


@helper
def acceleration(c, w, side):
    """Angular and linear acceleration of a port, minus gravity, World axes."""
    if side.body == ON_GROUND:
        return (0.0, 0.0, 0.0), vec3(w.ground, 0)
    R = mat3(w.body[side.body].pose_rotation, 0)
    alpha, a = port_acceleration(c, w, side.body, side.port)
    return times(R, alpha), times(R, a)


@helper
def norm1(x):
    return abs(x[0]) + abs(x[1]) + abs(x[2])


@helper
def evaluate_rows(c, w, cc, cw, accelerated):
    """Fill cw.closure and cw.row; row accelerations only where `accelerated`, which needs those of the bodies."""
    fastest = 0.0
    for rate in w.u:
        fastest = max(fastest, abs(rate))
    for i in range(cc.closure.shape[0]):
        A, B = cc.side[i, 0], cc.side[i, 1]
        x_a, R_a = pose(w, A)
        x_b, R_b = pose(w, B)
        omega_a, v_a = velocity(w, A)
        omega_b, v_b = velocity(w, B)
        R = matmul(transpose(R_a), R_b)
        p = times_t(R_a, sub(x_b, x_a))
        carrier = times_t(R_a, omega_a)
        spin = times_t(R_a, sub(omega_b, omega_a))
        speed = sub(times_t(R_a, sub(v_b, v_a)), cross(carrier, p))
        store9(cw.closure[i].rotation, 0, R)
        store3(cw.closure[i].position, 0, p)
        store9(cw.closure[i].world, 0, R_a)
        cw.closure[i].size = cc.length[0] + norm1(x_a)
        turns = norm1(omega_a) + norm1(omega_b)
        cw.closure[i].speed = norm1(v_a) + norm1(v_b) + cc.length[0] * (turns + fastest)
        for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
            _row(cc, cw, r, R, p, spin, speed)
        if accelerated:
            alpha_a, a_a = acceleration(c, w, A)
            alpha_b, a_b = acceleration(c, w, B)
            turning = times_t(R_a, alpha_a)
            spin_rate = sub(times_t(R_a, sub(alpha_b, alpha_a)), cross(carrier, spin))
            inner = add(cross(carrier, p), scale(2.0, speed))
            speed_rate = sub(sub(times_t(R_a, sub(a_b, a_a)), cross(turning, p)), cross(carrier, inner))
            for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
                _row_acceleration(cc, cw, r, R, spin, spin_rate, speed_rate)


@helper
def axes(axis, R):
    """The axes a of A and R b, b of B, that rotation row `axis` sets at right angles, in A axes."""
    if axis == 0:
        return (0.0, -1.0, 0.0), (R[2], R[5], R[8])
    if axis == 1:
        return (1.0, 0.0, 0.0), (R[2], R[5], R[8])
    return (-1.0, 0.0, 0.0), (R[1], R[4], R[7])


@helper
def _row(cc, cw, r, R, p, spin, speed):
    axis = cc.row[r].axis
    if cc.row[r].type == ROTATION:
        a, b = axes(axis, R)
        direction = cross(b, a)
        store3(cw.row[r].direction, 0, direction)
        cw.row[r].value = dot(a, b)
        cw.row[r].rate = dot(direction, spin)
    else:
        for n in range(3):
            cw.row[r].direction[n] = 1.0 if n == axis else 0.0
        cw.row[r].value = p[0] if axis == 0 else p[1] if axis == 1 else p[2]
        cw.row[r].rate = speed[0] if axis == 0 else speed[1] if axis == 1 else speed[2]


@helper
def _row_acceleration(cc, cw, r, R, spin, spin_rate, speed_rate):
    axis = cc.row[r].axis
    if cc.row[r].type == ROTATION:
        a, b = axes(axis, R)
        cw.row[r].acceleration = dot(cross(b, a), spin_rate) + dot(a, cross(spin, cross(spin, b)))
    else:
        cw.row[r].acceleration = speed_rate[0] if axis == 0 else speed_rate[1] if axis == 1 else speed_rate[2]


@helper
def load_on_b(cc, cw, i):
    """[torque about B, force] of the rows' loads of closure i on B, A axes."""
    tau, f = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
        part = scale(cw.row[r].load, vec3(cw.row[r].direction, 0))
        if cc.row[r].type == ROTATION:
            tau = add(tau, part)
        else:
            f = add(f, part)
    return tau, f


@helper
def largest_gap(cc, cw):
    """Largest weighted value of a row in the size of its closure, and the closure: (gap, i)."""
    worst, at = 0.0, 0
    for r in range(cc.row.shape[0]):
        i = cc.row[r].closure
        value = abs(cw.row[r].value) * cc.weight[r]
        if value > worst * cw.closure[i].size:
            worst, at = value / cw.closure[i].size, i
    return worst, at


@helper
def fastest_opening(cc, cw, slowest):
    """Largest weighted rate of a row in the speed of its closure, and the closure: (rate, i).

    `slowest` (1/s): sizes of its closure that speed is at least.
    """
    worst, at = 0.0, 0
    for r in range(cc.row.shape[0]):
        i = cc.row[r].closure
        value = abs(cw.row[r].rate) * cc.weight[r]
        speed = cw.closure[i].speed + slowest * cw.closure[i].size
        if value > worst * speed:
            worst, at = value / speed, i
    return worst, at
