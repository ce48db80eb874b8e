"""A row of virtual speeds m times the derivatives of R = M udot + b - T by constants of a tree, after `pulled.pull`.

The force F = I A + V x* I V of a rigid body has the virtual power B(W, A) - B(V x W, V) with

    B(X, Y) = X' I Y = x.J y + x.(s x y') - x'.(s x y) + m x'.y'        X = (x, x'), Y = (y, y')

which is linear in its ten numbers. A displacement J of the inboard frame of a hinge moves all beyond as that of a hinge
speed does, with V0, A0 and W0 of its inboard frame:

    (A0 x J + V0 x (V0 x J)) . G2 + (V0 x J) . G1 + J . G0 + W0 . (J x* F).
"""

from flexmb.jain.derivatives.pull_tables import ARMATURE, DAMPING, G0, G1, G2, REST, STIFFNESS, W
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, sweep
from flexmb.spatial.cross6 import force_cross, motion_cross
from flexmb.spatial.spatial_vector import ZERO6, shift_force, shift_motion, sub6, sum6, times6_t, vec6
from flexmb.spatial.vector import add, add3, cross, dot, mat3, sub, times, times_t, vec3
from flexmb.tables.features import ARMATURES, DAMPERS, MODES, SPRINGS


@sweep
def pull_constants(c, w, d, p):
    """Add m'dR by all constants that `Pulled` has to its tables."""
    for k in range(c.body.shape[0]):
        if c.body[k].modes == 0:
            _rigid(c, d, p, k)
        if c.body[k].inboard_port < 0:
            _placement(c, w, d, p, k)
    for j in range(w.u.shape[0]):
        _spring(c, w, p, j)


@helper
def _rigid(c, d, p, k):
    R, r = mat3(d.body[k].rotation, 0), vec3(d.body[k].position, 0)
    V = times6_t(R, shift_motion(vec6(d.body[k].velocity, 0), r))
    A = times6_t(R, shift_motion(vec6(d.body[k].accel, 0), r))
    X = times6_t(R, shift_motion(vec6(p.body[k], W), r))
    first, second = _product(X, A), _product(motion_cross(V, X), V)
    for i in range(10):
        p.rigid[k, i] += first[i] - second[i]


@helper
def _product(X, Y):
    """The derivatives (10) of X'I Y by mass, first moment and inertia."""
    (x, X_v), (y, Y_v) = X, Y
    s = add(cross(Y_v, x), cross(X_v, y))
    return (
        dot(X_v, Y_v), s[0], s[1], s[2], x[0] * y[0], x[1] * y[1], x[2] * y[2],
        x[0] * y[1] + x[1] * y[0], x[0] * y[2] + x[2] * y[0], x[1] * y[2] + x[2] * y[1],
    )  # fmt: skip


@helper
def _placement(c, w, d, p, k):
    """By a displacement of the inboard frame, then by its turn, both in the parent's axes; of the ground by gravity."""
    parent, a, F = c.body[k].parent, p.body[k], vec6(d.body[k].force, 0)
    if parent < 0:
        V, A, X, r = ZERO6, (ZERO6[0], vec3(w.ground, 0)), ZERO6, ZERO6[0]
        by = _by_displacement(a, F, V, A, X)
        position, turn = by[1], by[0]
        add3(p.gravity, 0, _minus(vec3(a, G2 + 3)))
    else:
        if d.places[k].new_point:
            F = shift_force(F, vec3(d.body[k].step, 0))
        R = mat3(d.body[parent].rotation, 0)
        V, A, X = vec6(d.body[parent].velocity, 0), vec6(d.body[parent].accel, 0), vec6(p.body[parent], W)
        r = vec3(d.body[parent].origin if has(c, MODES) else d.body[parent].position, 0)
        r = add(r, times(R, vec3(c.body[k].placement_position, 0)))
        by = _by_displacement(a, F, V, A, X)
        position, turn = times_t(R, by[1]), times_t(R, sub(by[0], cross(r, by[1])))
    add3(p.placement[k], 0, position)
    add3(p.placement[k], 3, turn)


@helper
def _minus(v):
    return -v[0], -v[1], -v[2]


@helper
def _by_displacement(a, F, V, A, X):
    """The force (6) on whose product with J the virtual power changes; F about the point of V, A, X and a."""
    G = vec6(a, G2)
    total = sub6(force_cross(V, force_cross(V, G)), force_cross(A, G))
    total = sub6(total, force_cross(V, vec6(a, G1)))
    return sum6(total, sub6(vec6(a, G0), force_cross(X, F)))


@helper
def _spring(c, w, p, j):
    m, i = p.virtual.speed[j], c.speed[j].coordinate
    if has(c, SPRINGS) and i >= 0:
        p.spring[j, STIFFNESS] += m * (w.q[i] - c.speed[j].rest)
        p.spring[j, REST] -= m * c.speed[j].stiffness
    if has(c, DAMPERS):
        p.spring[j, DAMPING] += m * w.u[j]
    if has(c, ARMATURES):
        p.spring[j, ARMATURE] += m * w.speed[j].acceleration
