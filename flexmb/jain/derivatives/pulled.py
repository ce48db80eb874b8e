"""A row of virtual speeds m times the derivatives of R = M udot + b - T, in O(N), without any matrix.

m'R is the virtual power of the forces F of all bodies on their virtual velocities W, the motion that the virtual speeds
make. A source moves all that lies beyond it by s0, s1 and s2 (`flexmb.jain.derivatives.motion`), and the virtual power
changes by

    s2 . G2 + s1 . G1 + s0 . G0 + W . (s0 x* F),    G2 = sum I W,  G1 = sum D'W,  G0 = sum E'W,  F = sum F

over all bodies beyond, with W in the last term that of the source's hinge or port itself. The sums are those of one
sweep inward, so that each source takes some fifty products; the rows and columns of `flexmb.jain.derivatives.rows` are
the terms of these sums one by one.
"""

from flexmb.jain.derivatives.attached import wheel_axis
from flexmb.jain.derivatives.flexible import bend
from flexmb.jain.derivatives.hinges import force_to_world, outboard_rotation, to_world
from flexmb.jain.derivatives.modes import in_body_axes
from flexmb.jain.derivatives.pull_tables import G0, G1, G2, W_HINGE, W
from flexmb.jain.derivatives.strips_of import six_of
from flexmb.jain.derivatives.sweeps import forces_of_bodies
from flexmb.jain.derivatives.tables import (
    BY_ACCELERATION,
    BY_RATE,
    MODE_BY_RATE,
    MODE_FORCE,
    MODE_ROW,
    MOTION,
    SPEED_BY_ACCELERATION,
)
from flexmb.jain.innovations import innovations, respond
from flexmb.jain.response import clear_forces
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.levels.body import is_at_rest
from flexmb.spatial.cross6 import force_cross, motion_cross
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.rows import column3, column6
from flexmb.spatial.spatial_vector import (
    ZERO6,
    add6,
    axpy6,
    dot6,
    scale6,
    shift_force,
    shift_motion,
    store6,
    sum6,
    vec6,
)
from flexmb.spatial.vector import add, cross, dot, mat3, scale, times_t, vec3
from flexmb.tables.arrays import ON_GROUND
from flexmb.tables.features import CONNECTORS, INBOARD_NODES, LOADS, MODES, OUTBOARD_NODES, SEVERAL, WHEELS

ZERO3 = (0.0, 0.0, 0.0)


@helper
def pull(c, w, d, p):
    """Replace T in p.virtual.speed by m = -M^-1 T, and write m'dR by displacements and speeds to p.row, but for T.

    Needs forward dynamics in w.
    """
    forces_of_bodies(c, w, d)
    if has(c, SEVERAL) or has(c, MODES) or has(c, WHEELS):
        _solve(c, w, p)
    else:
        _solve_single_axes(c, w, d, p)
    for k in range(c.body.shape[0]):
        _virtual_motion(c, d, p, k)
    if has(c, CONNECTORS):
        _pull_connectors(c, d, p)
    for k in range(c.body.shape[0] - 1, -1, -1):
        bend(c, w, d, k)
        _own(c, d, p, k)
        if has(c, MODES) or has(c, LOADS) or has(c, WHEELS) or has(c, CONNECTORS):
            _ports(c, w, d, p, k)
        if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0 and not is_at_rest(c.body[k].level):
            _frame(c, d, p, k)
        _hinge(c, w, d, p, k)


@sweep
def _solve(c, w, p):
    for j in range(w.u.shape[0]):
        p.virtual.speed[j] = -p.virtual.speed[j]
    clear_forces(c, p.virtual)
    innovations(c, w, p.virtual)
    respond(c, w, p.virtual)


@helper
def _solve_single_axes(c, w, d, p):
    """The same in World axes, as `flexmb.jain.derivatives.solve` does for many columns."""
    speed = p.virtual.speed
    for k in range(c.body.shape[0]):
        store6(p.body[k], G2, ZERO6)
    for k in range(c.body.shape[0] - 1, -1, -1):
        j, parent, z = c.body[k].u_index, c.body[k].parent, vec6(p.body[k], G2)
        gain = force_to_world(mat3(d.body[k].rotation, 0), vec3(d.body[k].position, 0), vec6(w.body[k].gain, 0))
        store6(p.body[k], G1, gain)
        y = -speed[j] - dot6(column6(d.seed, d.places[k].slot), z)
        speed[j] = y
        if parent >= 0:
            z = axpy6(y, gain, z)
            add6(p.body[parent], G2, shift_force(z, vec3(d.body[k].step, 0)) if d.places[k].new_point else z)
    for k in range(c.body.shape[0]):
        j, A = c.body[k].u_index, inboard_virtual(c, d, p, k)
        speed[j] = speed[j] / w.body[k].inertia_along - dot6(vec6(p.body[k], G1), A)
        store6(p.body[k], W, axpy6(speed[j], column6(d.seed, d.places[k].slot), A))


@helper
def _virtual_motion(c, d, p, k):
    """W of body k and of its ports; no G yet."""
    j, slot = c.body[k].u_index, d.places[k].slot
    V = inboard_virtual(c, d, p, k)
    for n in range(c.body[k].nv):
        V = axpy6(p.virtual.speed[j + n], column6(d.seed, slot + n), V)
    store6(p.body[k], W_HINGE, V)
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        for n in range(c.body[k].modes):
            V = axpy6(p.virtual.speed[c.body[k].etad_index + n], six_of(d.frame_mode[k], MOTION, n), V)
    store6(p.body[k], W, V)
    for row in range(G2, G0 + 6):
        p.body[k, row] = 0.0
    if has(c, MODES) or has(c, LOADS) or has(c, WHEELS) or has(c, CONNECTORS):
        for i in range(c.body[k].port_start, c.body[k].port_stop):
            if d.port[i].used:
                V = vec6(p.body[k], W)
                for n in range(c.body[k].modes):
                    V = axpy6(p.virtual.speed[c.body[k].etad_index + n], six_of(d.port_mode[i], MOTION, n), V)
                store6(p.port[i], W, V)
                for row in range(G2, G0 + 6):
                    p.port[i, row] = 0.0


@helper
def inboard_virtual(c, d, p, k):
    """W of the inboard frame of hinge k, about the base point of body k."""
    parent = c.body[k].parent
    if parent < 0:
        return ZERO6
    V = vec6(p.body[parent], W)
    if has(c, INBOARD_NODES) and c.body[k].inboard_port >= 0:
        V = vec6(p.port[c.body[k].inboard_port], W)
    return shift_motion(V, vec3(d.body[k].step, 0)) if d.places[k].new_point else V


@helper
def _add_own(c, a, answer):
    """Add D'W and E'W of what is at a body or port itself to its row of G."""
    V, D = vec6(a, W), answer.by_rate
    turn = add(times_t(mat3(D, 0), V[0]), times_t(mat3(D, 9), V[1]))
    add6(a, G1, (turn, ZERO3))
    if has(c, LOADS) or has(c, CONNECTORS):
        E = answer.by_turn
        add6(a, G0, (add(times_t(mat3(E, 0), V[0]), times_t(mat3(E, 9), V[1])), ZERO3))


@helper
def _own(c, d, p, k):
    """Add what body k and its modes do to the sums G of body k."""
    a = p.body[k]
    add6(a, G2, inertia_times(load_inertia(d.body[k].inertia, 0), vec6(a, W)))
    _add_own(c, a, d.body[k])
    if has(c, MODES):
        start, first, mode = c.body[k].etad_index, d.places[k].modes, d.mode[k]
        nm, nu = c.body[k].modes, d.speed.shape[0]
        for n in range(nm):
            m = p.virtual.speed[start + n]
            add6(a, G2, scale6(m, six_of(mode, MODE_ROW, n)))
            add6(a, G1, (scale(m, column3(mode, MODE_BY_RATE, n)), ZERO3))
            p.row[first + n] = dot6(vec6(a, W), six_of(mode, MODE_FORCE, n))
            p.row[nu + first + n] = dot6(vec6(a, W), six_of(mode, MODE_FORCE + 6, n))
        for i in range(nm):
            m, row = p.virtual.speed[start + i], d.matrix[first + i]
            for n in range(nm):
                p.row[first + n] += m * row[first + n]
                p.row[nu + first + n] += m * row[nu + first + n]


@helper
def _pull_of(c, a, s1, s2):
    """s2 . G2 + s1 . G1; without connectors only angular parts of s1 have an effect."""
    G = vec6(a, G1)
    return dot6(vec6(a, G2), s2) + (dot6(G, s1) if has(c, CONNECTORS) else dot(G[0], s1[0]))


@helper
def _pull_of_turn(c, a, X, F, J):
    """s0 . G0 + X . (s0 x* F) for s0 = J."""
    total = dot6(X, force_cross(J, F))
    if has(c, CONNECTORS):
        return total + dot6(vec6(a, G0), J)
    return total + dot(vec3(a, G0), J[0]) if has(c, LOADS) else total


@helper
def _ports(c, w, d, p, k):
    """What is attached to the ports of body k: columns of its modes, and the sums and the force of the body."""
    first, nu = d.places[k].modes, d.speed.shape[0]
    for i in range(c.body[k].port_start, c.body[k].port_stop):
        if not d.port[i].used:
            continue
        a = p.port[i]
        _add_own(c, a, d.port[i])
        if has(c, WHEELS):
            _wheels(c, w, d, p, k, i)
        if has(c, MODES) and not is_at_rest(c.body[k].level):
            F, moved = vec6(d.port[i].force, 0), d.port_mode[i]
            F_body = in_body_axes(mat3(d.body[k].rotation, 0), vec3(d.port[i].position, 0), F)
            for n in range(c.body[k].modes):
                J = six_of(moved, MOTION, n)
                total = _pull_of(c, a, six_of(moved, BY_RATE, n), six_of(moved, BY_ACCELERATION, n))
                total += _pull_of_turn(c, a, vec6(a, W), F, J)
                for j in range(c.body[k].modes):
                    m = p.virtual.speed[c.body[k].etad_index + j]
                    total += m * dot6(F_body, column6(d.bent[i, j], n))
                p.row[first + n] += total
                p.row[nu + first + n] += _pull_of(c, a, J, six_of(moved, SPEED_BY_ACCELERATION, n))
        for row in range(G2, G0 + 6):
            p.body[k, row] += p.port[i, row]
        add6(d.body[k].force, 0, vec6(d.port[i].force, 0))


@helper
def _frame(c, d, p, k):
    """Columns of the modes of body k, which move its frame against the hinge point O, and all that it carries."""
    first, nu, nm, a, moved = d.places[k].modes, d.speed.shape[0], c.body[k].modes, p.body[k], d.frame_mode[k]
    F = vec6(d.body[k].force, 0)
    F_body = in_body_axes(mat3(d.body[k].rotation, 0), vec3(d.body[k].position, 0), F)
    for n in range(nm):
        J = six_of(moved, MOTION, n)
        total = _pull_of(c, a, six_of(moved, BY_RATE, n), six_of(moved, BY_ACCELERATION, n))
        total += _pull_of_turn(c, a, vec6(a, W_HINGE), F, J)
        for j in range(nm):
            m = p.virtual.speed[c.body[k].etad_index + j]
            total -= m * dot6(F_body, column6(d.bent[c.body[k].outboard_port, j], n))
        p.row[first + n] += total
        p.row[nu + first + n] += _pull_of(c, a, J, six_of(moved, SPEED_BY_ACCELERATION, n))


@helper
def _wheels(c, w, d, p, k, port):
    """Rows and columns of the wheels at one port."""
    nu = d.speed.shape[0]
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        if c.wheel[i].port == port:
            place = d.places[k].wheels + i - c.body[k].wheel_start
            m = p.virtual.speed[c.wheel[i].u_index]
            l2 = scale(c.wheel[i].axial, wheel_axis(c, w, d, k, i))
            l1 = cross(vec3(d.port[port].velocity, 0), l2)
            add6(p.port[port], G2, (scale(m, l2), ZERO3))
            add6(p.port[port], G1, (scale(m, l1), ZERO3))
            p.row[place] = 0.0
            p.row[nu + place] = dot(vec3(p.port[port], W), l1)


@helper
def _hinge(c, w, d, p, k):
    """Columns of hinge k; what it carries is added to the sums of its parent, or of the port that it sits on."""
    nu, first, slot, a = d.speed.shape[0], d.places[k].hinge, d.places[k].slot, p.body[k]
    F = vec6(d.body[k].force, 0)
    for n in range(c.body[k].nv):
        J = column6(d.seed, slot + n)
        s2 = six_of(d.seed, BY_ACCELERATION, slot + n)
        p.row[first + n] = _pull_of(c, a, six_of(d.seed, BY_RATE, slot + n), s2)
        p.row[first + n] += _pull_of_turn(c, a, vec6(a, W_HINGE), F, J)
        p.row[nu + first + n] = _pull_of(c, a, J, six_of(d.seed, SPEED_BY_ACCELERATION, slot + n))
    if has(c, SEVERAL) and c.body[k].axis < 0:
        _same_hinge(c, w, d, p, k, F)
    parent = c.body[k].parent
    if parent < 0:
        return
    if d.places[k].new_point:
        step = vec3(d.body[k].step, 0)
        F = shift_force(F, step)
        for row in range(G2, G0 + 6, 6):
            store6(a, row, shift_force(vec6(a, row), step))
    i = c.body[k].inboard_port
    if has(c, INBOARD_NODES) and i >= 0:
        add6(d.port[i].force, 0, F)
        for row in range(G2, G0 + 6):
            p.port[i, row] += a[row]
    else:
        add6(d.body[parent].force, 0, F)
        for row in range(G2, G0 + 6):
            p.body[parent, row] += a[row]


@helper
def _same_hinge(c, w, d, p, k, F):
    """Add m_i (J_n x J_i + dJ_i) . F: the motion of speed i by displacement n of the same hinge."""
    R, r = outboard_rotation(c, w, d, k), vec3(d.body[k].position, 0)
    first, slot = d.places[k].hinge, d.places[k].slot
    for n in range(c.body[k].nv):
        J = column6(d.seed, slot + n)
        for i in range(c.body[k].nv):
            change = to_world(R, r, column6(d.moved[k, n], i))
            change = sum6(motion_cross(J, column6(d.seed, slot + i)), change)
            p.row[first + n] += p.virtual.speed[c.body[k].u_index + i] * dot6(change, F)


@sweep
def _pull_connectors(c, d, p):
    """What connectors do to the sums G of the ports at their ends."""
    for i in range(c.connector.shape[0]):
        J = d.passed_row
        for n in range(J.shape[0]):
            J[n] = 0.0
        for side in range(2):
            if c.end[i, side].body != ON_GROUND:
                port = c.end[i, side].port
                V = shift_motion(vec6(p.port[port], W), vec3(d.port[port].position, 0))
                for n in range(J.shape[0]):
                    for row in range(3):
                        J[n] += V[0][row] * d.link[i, 6 * side + row, n] + V[1][row] * d.link[i, 6 * side + 3 + row, n]
        for side in range(2):
            if c.end[i, side].body != ON_GROUND:
                port = c.end[i, side].port
                r = vec3(d.port[port].position, 0)
                add6(p.port[port], G0, shift_force(vec6(J, 12 * side), r))
                add6(p.port[port], G1, shift_force(vec6(J, 12 * side + 6), r))
