"""The inward sweep of `flexmb.jain.derivatives.rows` for trees of rigid bodies on single axes, which carry no more.

All that a rigid body carries answers with the mass m, the first moment s, the inertia J, N = sum m r v', the momentum p
and the force F, 26 numbers about the base point. They stay in registers along a stretch of the tree (see
`flexmb.jain.derivatives.tables`), and are stored only where it forks. To s2 = (alpha, a) and s1 = (x, y) the answer is

    torque    J alpha + s x a + 2 (tr N - N') x      force    m a + alpha x s + 2 x x p
"""

from flexmb.jain.derivatives.columns import at_inboard_point, inboard_columns, own_columns
from flexmb.jain.derivatives.rigid import moved_moments, shifted_inertia, times_sym
from flexmb.jain.derivatives.rows import BY_RATES, BY_SPEED, put_force, shift_columns
from flexmb.jain.derivatives.strips_of import six_of
from flexmb.jain.derivatives.tables import BY_ACCELERATION, BY_RATE, SPEED_BY_ACCELERATION
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.cross6 import force_cross
from flexmb.spatial.rows import column3, column6
from flexmb.spatial.spatial_vector import shift_force, store6, sum6, vec6
from flexmb.spatial.vector import add, axpy, cross, dot, mat3, plus_cross, rotate_sym, scale, store3, sub, sym6, vec3
from flexmb.tables.features import ARMATURES

ZERO3 = (0.0, 0.0, 0.0)
NOTHING = (0.0, ZERO3, (*ZERO3, *ZERO3), (ZERO3, ZERO3, ZERO3), ZERO3, (ZERO3, ZERO3))
_M, _S, _J, _N, _P, _F = 0, 1, 4, 10, 19, 22  # where `carried` has m, s, J, N, p and F


@helper
def rigid_tree(c, w, d, masses):
    """Rows and columns of all hinges, after `move` of all bodies."""
    for i in range(d.fork.shape[0]):
        _store(d.carried[d.fork[i]], NOTHING)
    answer = NOTHING
    for i in range(d.stretch.shape[0] - 1, -1, -1):
        start, stop = d.stretch[i].start, d.stretch[i].stop
        if d.stretch[i].ends:
            answer = NOTHING
        if d.stretch[i].forks:
            answer = _sum(answer, _load(d.carried[d.order[stop - 1]]))
        for j in range(stop - 1, start - 1, -1):
            k = d.order[j]
            answer = _sum(answer, _own(c, d, k))
            _column(d, k, answer)
            _row(c, w, d, k, answer, masses)
        answer = _to_inboard_point(c, d, d.order[start], answer, masses)


@helper
def _own(c, d, k):
    """The answer of body k alone."""
    own = c.body[k].rigid
    R, r, V, A = mat3(d.body[k].rotation, 0), vec3(d.body[k].position, 0), vec6(d.body[k].velocity, 0), d.body[k].accel
    m, s = own[0], _times(R, vec3(own, 1))
    J = shifted_inertia(m, s, rotate_sym(R, sym6(own, 4)), r)
    s = axpy(m, r, s)
    momentum = _inertia_times(m, s, J, V)
    N = moved_moments(s, J, V)
    F = sum6(_inertia_times(m, s, J, vec6(A, 0)), force_cross(V, momentum))
    return m, s, J, ((N[0], N[1], N[2]), (N[3], N[4], N[5]), (N[6], N[7], N[8])), momentum[1], F


@helper
def _times(R, v):
    return (
        R[0] * v[0] + R[1] * v[1] + R[2] * v[2],
        R[3] * v[0] + R[4] * v[1] + R[5] * v[2],
        R[6] * v[0] + R[7] * v[1] + R[8] * v[2],
    )


@helper
def _inertia_times(m, s, J, A):
    """The momentum of a motion, or the force of an acceleration."""
    return plus_cross(times_sym(J, A[0]), s, A[1]), plus_cross(scale(m, A[1]), A[0], s)


@helper
def _sum(a, b):
    N = add(a[3][0], b[3][0]), add(a[3][1], b[3][1]), add(a[3][2], b[3][2])
    J, K = a[2], b[2]
    inertia = J[0] + K[0], J[1] + K[1], J[2] + K[2], J[3] + K[3], J[4] + K[4], J[5] + K[5]
    return a[0] + b[0], add(a[1], b[1]), inertia, N, add(a[4], b[4]), sum6(a[5], b[5])


@helper
def _by_angle(answer, x):
    """The force (6) that a change x of the angular velocity causes."""
    N, p = answer[3], answer[4]
    trace = N[0][0] + N[1][1] + N[2][2]
    turned = axpy(x[0], N[0], axpy(x[1], N[1], scale(x[2], N[2])))
    return scale(2.0, sub(scale(trace, x), turned)), scale(2.0, cross(x, p))


@helper
def _row_by_angle(answer, J):
    """The row (3) of a motion J in `_by_angle`."""
    N, p = answer[3], answer[4]
    a, b = J
    trace = N[0][0] + N[1][1] + N[2][2]
    turned = dot(N[0], a), dot(N[1], a), dot(N[2], a)
    return scale(2.0, add(sub(scale(trace, a), turned), cross(p, b)))


@helper
def _column(d, k, answer):
    """Change of the load across hinge k by its displacement and its speed; the load of its unit acceleration."""
    place, slot = d.places[k].hinge, d.places[k].slot
    m, s, J, _, _, F = answer
    motion = column6(d.seed, slot)
    X = _inertia_times(m, s, J, six_of(d.seed, BY_ACCELERATION, slot))
    X = sum6(X, _by_angle(answer, column3(d.seed, BY_RATE, slot)))
    put_force(d, 0, place, sum6(X, force_cross(motion, F)))
    X = _inertia_times(m, s, J, six_of(d.seed, SPEED_BY_ACCELERATION, slot))
    put_force(d, BY_SPEED, place, sum6(X, _by_angle(answer, motion[0])))
    put_force(d, BY_RATES, place, _inertia_times(m, s, J, motion))


@helper
def _row(c, w, d, k, answer, masses):
    """Row of hinge k for all sources inboard and beyond."""
    place, slot = d.places[k].hinge, d.places[k].slot
    J, l2 = column6(d.seed, slot), six_of(d.force, BY_RATES, place)
    l1 = _row_by_angle(answer, J)
    if d.places[k].leaves_point:
        l2 = at_inboard_point(l2, vec3(d.body[k].step, 0))
    inboard_columns(c, d, place, (d.places[k].inboard_run, d.places[k].inboard_end), (l2, l1, ZERO3), masses)
    own_columns(d, J, place, place, d.places[k].stop, masses)
    if has(c, ARMATURES) and masses:
        d.matrix[place, 2 * w.u.shape[0] + place] += c.speed[c.body[k].u_index].armature


@helper
def _to_inboard_point(c, d, k, answer, masses):
    """The answer about the base point of the body on which body k sits, the first of its stretch."""
    p = c.body[k].parent
    if p >= 0 and d.places[k].new_point:
        step = vec3(d.body[k].step, 0)
        m, s, J, N, momentum, F = answer
        J = shifted_inertia(m, s, J, step)
        N = axpy(step[0], momentum, N[0]), axpy(step[1], momentum, N[1]), axpy(step[2], momentum, N[2])
        answer = m, axpy(m, step, s), J, N, momentum, shift_force(F, step)
        shift_columns(d, step, d.places[k].hinge, d.places[k].stop, masses)
    if d.places[k].branches:
        _store(d.carried[p], _sum(answer, _load(d.carried[p])))
    return answer


@helper
def _load(a):
    N = vec3(a, _N), vec3(a, _N + 3), vec3(a, _N + 6)
    return a[_M], vec3(a, _S), sym6(a, _J), N, vec3(a, _P), vec6(a, _F)


@helper
def _store(a, answer):
    m, s, J, N, p, F = answer
    a[_M] = m
    store3(a, _S, s)
    store6(a, _J, ((J[0], J[1], J[2]), (J[3], J[4], J[5])))
    for i in range(3):
        store3(a, _N + 3 * i, N[i])
    store3(a, _P, p)
    store6(a, _F, F)
