"""Inward: what bodies answer to a change of their motion, and with it the derivatives of M udot + b.

I, D and E of a body and of all that it carries say how the force F across its hinge changes with s2, and with the
angular parts of s1 and s0, in axes that move with the bodies. A hinge speed with motion J has the row
[l2 l1 l0] = J'[I D E] for all sources inboard. A source with s0, s1, s2 adds X = I s2 + D s1 + E s0 + s0 x* F to the
load across every hinge inboard, because all that it moves turns with s0.

    row i beyond the source n: l2_i . s2_n + l1_i . s1_n + l0_i . s0_n      row i inboard of it: J_i . X_n

Armatures act along their own speed alone: they are on the diagonal of M.
"""

from flexmb.jain.derivatives.columns import at_inboard_point, inboard_columns, own_columns
from flexmb.jain.derivatives.hinges import outboard_rotation, to_world
from flexmb.jain.derivatives.strips_of import six_of
from flexmb.jain.derivatives.tables import BY_ACCELERATION, BY_RATE, SPEED_BY_ACCELERATION
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.cross6 import force_cross, motion_cross
from flexmb.spatial.inertia import add_inertia, inertia_times, load_inertia, shift_inertia, store_inertia
from flexmb.spatial.rows import column3, column6
from flexmb.spatial.spatial_vector import add6, dot6, shift_force, store6, sum6, vec6
from flexmb.spatial.vector import add, mat3, times, times_t, vec3
from flexmb.tables.features import ARMATURES, CONNECTORS, INBOARD_NODES, LOADS, MODES, SEVERAL

BY_SPEED, BY_RATES = 6, 12  # first rows of `force` for changes of speeds and of their rates


@helper
def inward(c, w, d, k, masses):
    """Rows and columns of body k's hinge; what it answers is added to its parent's answer."""
    first, slot = d.places[k].hinge, d.places[k].slot
    for n in range(c.body[k].nv):
        _column(c, d, k, first + n, slot + n)
    for n in range(c.body[k].nv):
        _row(c, d, k, first + n, slot + n, masses)
        if has(c, ARMATURES) and masses:
            d.matrix[first + n, 2 * w.u.shape[0] + first + n] += c.speed[c.body[k].u_index + n].armature
    if has(c, SEVERAL) and c.body[k].axis < 0:
        _same_hinge(c, w, d, k)
    p = c.body[k].parent
    if p >= 0:
        if has(c, MODES):
            # the modes of the parent, as body k sees them, on all that it carries
            for n in range(d.places[k].sees):
                J = column6(d.seed, d.places[k].seen + n)
                own_columns(d, J, d.places[p].modes + n, first, d.places[k].stop, masses)
        if d.places[k].new_point:
            _to_inboard_point(c, d, k, masses)
        _to_parent(c, d, k)


@helper
def by_angle(D, x):
    """The force (6) that a change x of an angle or an angular velocity causes, for D (18) by rows."""
    return times(mat3(D, 0), x), times(mat3(D, 9), x)


@helper
def row_by_angle(D, J):
    """The row J'D (3)."""
    return add(times_t(mat3(D, 0), J[0]), times_t(mat3(D, 9), J[1]))


@helper
def _column(c, d, k, place, slot):
    """Change of the load across the hinge by one of its speeds, and by its displacement; I J for the mass matrix."""
    J, s1 = column6(d.seed, slot), column3(d.seed, BY_RATE, slot)
    inertia, D = load_inertia(d.body[k].inertia, 0), d.body[k].by_rate
    X = sum6(inertia_times(inertia, six_of(d.seed, BY_ACCELERATION, slot)), by_angle(D, s1))
    if has(c, LOADS) or has(c, CONNECTORS):
        X = sum6(X, by_angle(d.body[k].by_turn, J[0]))
    put_force(d, 0, place, sum6(X, force_cross(J, vec6(d.body[k].force, 0))))
    X = sum6(inertia_times(inertia, six_of(d.seed, SPEED_BY_ACCELERATION, slot)), by_angle(D, J[0]))
    put_force(d, BY_SPEED, place, X)
    put_force(d, BY_RATES, place, inertia_times(inertia, J))


@helper
def _row(c, d, k, place, slot, masses):
    """Row of one speed of hinge k, for all sources inboard and beyond."""
    J, l2 = column6(d.seed, slot), six_of(d.force, BY_RATES, place)
    l1, l0 = row_by_angle(d.body[k].by_rate, J), (0.0, 0.0, 0.0)
    if has(c, LOADS) or has(c, CONNECTORS):
        l0 = row_by_angle(d.body[k].by_turn, J)
    if d.places[k].leaves_point:
        l2 = at_inboard_point(l2, vec3(d.body[k].step, 0))
    inboard_columns(c, d, place, (d.places[k].inboard_run, d.places[k].inboard_end), (l2, l1, l0), masses)
    own_columns(d, J, place, d.places[k].hinge, d.places[k].stop, masses)


@helper
def _same_hinge(c, w, d, k):
    """Add (J_n x J_i + dJ_i) . F: the motion of speed i by displacement n of the same hinge."""
    R, r, F = outboard_rotation(c, w, d, k), vec3(d.body[k].position, 0), vec6(d.body[k].force, 0)
    first, slot = d.places[k].hinge, d.places[k].slot
    for n in range(c.body[k].nv):
        J = column6(d.seed, slot + n)
        for i in range(c.body[k].nv):
            change = to_world(R, r, column6(d.moved[k, n], i))
            d.matrix[first + i, first + n] += dot6(sum6(motion_cross(J, column6(d.seed, slot + i)), change), F)


@helper
def put_force(d, row, place, F):
    """Store a force in column `place` of `force`, from row `row` on."""
    for i in range(3):
        d.force[row + i, place] = F[0][i]
        d.force[row + 3 + i, place] = F[1][i]


@helper
def _to_parent(c, d, k):
    """Add what body k and all that it carries answer to the answer of its parent, or of the port that it sits on."""
    p, i = c.body[k].parent, c.body[k].inboard_port
    if has(c, INBOARD_NODES) and i >= 0:
        add_answer(c, d.port[i], d.body[k])
    else:
        add_answer(c, d.body[p], d.body[k])


@helper
def add_answer(c, to, answer):
    """Add what one body or port with all that it carries answers to that of another, about the same point."""
    add_inertia(to.inertia, 0, load_inertia(answer.inertia, 0))
    add6(to.force, 0, vec6(answer.force, 0))
    for i in range(18):
        to.by_rate[i] += answer.by_rate[i]
    if has(c, LOADS) or has(c, CONNECTORS):
        for i in range(18):
            to.by_turn[i] += answer.by_turn[i]


@helper
def _to_inboard_point(c, d, k, masses):
    """Refer all that is passed on to the base point of the parent."""
    step = vec3(d.body[k].step, 0)
    store_inertia(d.body[k].inertia, 0, shift_inertia(load_inertia(d.body[k].inertia, 0), step))
    store6(d.body[k].force, 0, shift_force(vec6(d.body[k].force, 0), step))
    shift_by_angle(d.body[k].by_rate, step)
    if has(c, LOADS) or has(c, CONNECTORS):
        shift_by_angle(d.body[k].by_turn, step)
    shift_columns(d, step, d.places[k].hinge, d.places[k].stop, masses)


@helper
def shift_by_angle(D, step):
    """Torques of D (18) about another point; step leads from there to the present one."""
    x, y, z = step
    for i in range(3):
        a, b, c = D[9 + i], D[12 + i], D[15 + i]
        D[i] += y * c - z * b
        D[3 + i] += z * a - x * c
        D[6 + i] += x * b - y * a


@helper
def shift_columns(d, step, start, stop, masses):
    """Refer columns start .. stop of `force` to another point; step leads from there to the present one."""
    for row in range(0, 18 if masses else 12, 6):
        _shift_rows(d, step, row, start, stop)


@helper
def _shift_rows(d, step, row, start, stop):
    """The same for columns start .. stop of `force`, in six rows from `row` on."""
    x, y, z = step
    a, b, e = d.force[row], d.force[row + 1], d.force[row + 2]
    f, g, h = d.force[row + 3], d.force[row + 4], d.force[row + 5]
    for n in range(start, stop):
        a[n] += y * h[n] - z * g[n]
        b[n] += z * f[n] - x * h[n]
        e[n] += x * g[n] - y * f[n]
