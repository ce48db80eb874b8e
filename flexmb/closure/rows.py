"""The rows of a closure, its suppressed motions: value, rate and acceleration, from the motion of its two ports.

Relative motion of frame B seen from frame A, in A axes: R_AB = R_WA'R_WB, p_AB = R_WA'(p_WB - p_WA), W being World,
and their rates. A translation row along axis i is p_AB,i. A rotation row makes an axis a of A orthogonal to an axis b
of B, g = a . R_AB b:

    about x: a = -y, b = z      about y: a = x, b = z      about z: a = -x, b = y,

so that near R_AB = 1 the row is the component of the relative rotation about that axis. Its unit load is the torque
R_AB b x a.
"""

from flexmb.closure.couplings import evaluate_coupling, is_coupling, measure_coupling
from flexmb.closure.tables import COUPLINGS, ON_GROUND, ROTATION
from flexmb.jain.ports import port_acceleration, port_velocity
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.spatial_vector import ZERO6, sub6, times6, times6_t
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
    """Position and rotation of a port in World. Requires the pose sweep."""
    if side.body == ON_GROUND:
        return vec3(side.position, 0), mat3(side.rotation, 0)
    R = mat3(w.body[side.body].pose_rotation, 0)
    position = add(vec3(w.body[side.body].pose_position, 0), times(R, vec3(w.port[side.port].r, 0)))
    return position, matmul(R, mat3(w.port[side.port].R, 0))


@helper
def velocity(w, side):
    """Velocity of a port, World axes."""
    if side.body == ON_GROUND:
        return ZERO6
    return times6(mat3(w.body[side.body].pose_rotation, 0), port_velocity(w, side.body, side.port))


@helper
def acceleration(c, w, side):
    """Acceleration of a port, minus gravity, World axes."""
    if side.body == ON_GROUND:
        return (0.0, 0.0, 0.0), vec3(w.ground, 0)
    return times6(mat3(w.body[side.body].pose_rotation, 0), port_acceleration(c, w, side.body, side.port))


@helper
def norm1(x):
    return abs(x[0]) + abs(x[1]) + abs(x[2])


@sweep
def evaluate_rows(c, w, cc, cw, accelerated):
    """Fill cw.closure and cw.row; row accelerations only if `accelerated`, which requires those of the bodies.

    p_WA, R_WA, V_WA, A_WA are frame A's position, rotation, velocity and acceleration in World; those of B from A, in A
    axes, are p_AB, R_AB, V_AB, A_AB.
    """
    fastest = 0.0
    for j in range(w.u.shape[0]):
        fastest = max(fastest, abs(w.u[j]))
    for i in range(cc.closure.shape[0]):
        if has(cc, COUPLINGS) and is_coupling(cc, i):
            evaluate_coupling(c, w, cc, cw, i, accelerated)
            measure_coupling(w, cc, cw, i, fastest)
        else:
            p_WA, V_WA, V_WB = evaluate_closure(c, w, cc, cw, i, accelerated)
            cw.closure[i].size = cc.length[0] + norm1(p_WA)
            turns = norm1(V_WA[0]) + norm1(V_WB[0])
            cw.closure[i].speed = norm1(V_WA[1]) + norm1(V_WB[1]) + cc.length[0] * (turns + fastest)


@helper
def evaluate_closure(c, w, cc, cw, i, accelerated):
    """As `evaluate_rows` for closure i, without its size and speed; returns p_WA, V_WA and V_WB."""
    A, B = cc.side[i, 0], cc.side[i, 1]
    p_WA, R_WA = pose(w, A)
    p_WB, R_WB = pose(w, B)
    V_WA, V_WB = velocity(w, A), velocity(w, B)
    R_AB = matmul(transpose(R_WA), R_WB)
    p_AB = times_t(R_WA, sub(p_WB, p_WA))
    w_A = times_t(R_WA, V_WA[0])
    V_AB = _relative_velocity(times6_t(R_WA, sub6(V_WB, V_WA)), w_A, p_AB)
    store9(cw.closure[i].rotation, 0, R_AB)
    store3(cw.closure[i].position, 0, p_AB)
    store9(cw.closure[i].world, 0, R_WA)
    for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
        _row(cc, cw, r, R_AB, p_AB, V_AB)
    if accelerated:
        A_WA, A_WB = acceleration(c, w, A), acceleration(c, w, B)
        alpha_A = times_t(R_WA, A_WA[0])
        A_AB = _relative_acceleration(times6_t(R_WA, sub6(A_WB, A_WA)), alpha_A, w_A, p_AB, V_AB)
        for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
            _row_acceleration(cc, cw, r, R_AB, V_AB, A_AB)
    return p_WA, V_WA, V_WB


@helper
def _relative_velocity(difference, w_A, p_AB):
    """V_AB from the difference of both frames' velocities and the angular velocity of A, A axes."""
    return difference[0], sub(difference[1], cross(w_A, p_AB))


@helper
def _relative_acceleration(difference, alpha_A, w_A, p_AB, V_AB):
    """A_AB from the difference of both frames' accelerations and the rotation of A, A axes."""
    inner = add(cross(w_A, p_AB), scale(2.0, V_AB[1]))
    linear = sub(sub(difference[1], cross(alpha_A, p_AB)), cross(w_A, inner))
    return sub(difference[0], cross(w_A, V_AB[0])), linear


@helper
def axes(axis, R_AB):
    """The axes a of A and R_AB b, b of B, that rotation row `axis` makes orthogonal, in A axes."""
    if axis == 0:
        return (0.0, -1.0, 0.0), (R_AB[2], R_AB[5], R_AB[8])
    if axis == 1:
        return (1.0, 0.0, 0.0), (R_AB[2], R_AB[5], R_AB[8])
    return (-1.0, 0.0, 0.0), (R_AB[1], R_AB[4], R_AB[7])


@helper
def _row(cc, cw, r, R_AB, p_AB, V_AB):
    """Direction, value and rate of row r."""
    axis = cc.row[r].axis
    if cc.row[r].type == ROTATION:
        a, b = axes(axis, R_AB)
        direction = cross(b, a)
        store3(cw.row[r].direction, 0, direction)
        cw.row[r].value = dot(a, b)
        cw.row[r].rate = dot(direction, V_AB[0])
    else:
        for n in range(3):
            cw.row[r].direction[n] = 1.0 if n == axis else 0.0
        cw.row[r].value = _component(p_AB, axis)
        cw.row[r].rate = _component(V_AB[1], axis)


@helper
def _row_acceleration(cc, cw, r, R_AB, V_AB, A_AB):
    """J udot + Jdot u of row r."""
    axis = cc.row[r].axis
    if cc.row[r].type == ROTATION:
        a, b = axes(axis, R_AB)
        spin = V_AB[0]
        cw.row[r].acceleration = dot(cross(b, a), A_AB[0]) + dot(a, cross(spin, cross(spin, b)))
    else:
        cw.row[r].acceleration = _component(A_AB[1], axis)


@helper
def _component(v, axis):
    return v[0] if axis == 0 else v[1] if axis == 1 else v[2]


@helper
def load_on_b(cc, cw, i):
    """[torque about B, force] of the rows' loads of closure i on B, A axes."""
    tau, f = ZERO6
    for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
        part = scale(cw.row[r].load, vec3(cw.row[r].direction, 0))
        if cc.row[r].type == ROTATION:
            tau = add(tau, part)
        else:
            f = add(f, part)
    return tau, f


@helper
def largest_gap(cc, cw):
    """Largest weighted value of a row relative to the size of its closure, and the closure: (gap, i)."""
    worst, at = 0.0, 0
    for r in range(cc.row.shape[0]):
        i = cc.row[r].closure
        value = abs(cw.row[r].value) * cc.weight[r]
        if value > worst * cw.closure[i].size:
            worst, at = value / cw.closure[i].size, i
    return worst, at


@helper
def fastest_opening(cc, cw, slowest):
    """Largest weighted rate of a row relative to the speed of its closure, and the closure: (rate, i).

    `slowest` (1/s): lower bound of that speed, in sizes of the closure.
    """
    worst, at = 0.0, 0
    for r in range(cc.row.shape[0]):
        i = cc.row[r].closure
        value = abs(cw.row[r].rate) * cc.weight[r]
        speed = cw.closure[i].speed + slowest * cw.closure[i].size
        if value > worst * speed:
            worst, at = value / speed, i
    return worst, at
