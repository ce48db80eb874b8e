"""Condition of M = F F' with respect to the rounding errors of the recursion.

The rounding error of an articulated inertia P is that of the sums before the eliminations subtracted from them, however
small the remainder is: about u s_i s_j in element i, j, where s_i^2 is the diagonal element before the elimination and
u the unit roundoff. Referred to the parent, s becomes t = |phi(arm)| |R| s, because terms that cancel in a shift are
rounded, too. In a motion x (nu,) of the speeds, rounding errors therefore amount to the energy u |S x|^2,

    |S x|^2 = sum over bodies  sum_i t_i^2 A_i^2  +  sum over hinge speeds  (sum_i s_i^2 h_i^2 + J_j) x_j^2
            + sum over modes (D_nn + sum_i s_i^2 Pi_in^2) x_n^2,

with A the acceleration of the point of the parent where the body is hinged, h a column of H, J_j the armature of a
speed, and Pi_n the motion by mode n of a node that carries O. The true energy is x'M x = |F'x|^2. The largest ratio of
the two, kappa = |S F'^-1|^2, is a condition number of M that does not depend on units; u kappa bounds the relative
error of the accelerations in the norm of S. Where u kappa reaches 1, there is a motion whose inertia is all rounding
error.
"""

from flexmb.jain.innovations import innovations, respond
from flexmb.jain.kinematics import motion_column
from flexmb.jain.ports import mode_motion
from flexmb.jain.response import clear_body, port_response, push
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.spatial_vector import add6, scale6, vec6
from flexmb.spatial.vector import add, mat3, times, vec3
from flexmb.tables.features import ARMATURES


@helper
def weigh(c, w, x):
    """y := F^-1 S'S F'^-1 y for the free speeds, y in x.speed. kappa is the largest eigenvalue of this operator."""
    respond(c, w, x)
    for k in range(c.body.shape[0]):
        clear_body(c, x, k)
    for k in range(c.body.shape[0]):
        s = _size(c, w, k)
        _weigh_modes(c, w, x, k, s)
        for n in range(c.body[k].nv):
            j = c.body[k].u_index + n
            size = _squares(s, motion_column(c, w, k, n))
            if has(c, ARMATURES):
                size += c.speed[j].armature
            x.speed[j] *= size
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            x.speed[c.wheel[i].u_index] *= c.wheel[i].axial
        if c.body[k].parent >= 0:
            _weigh_transfer(c, w, x, k, s)
    innovations(c, w, x)


@helper
def _size(c, w, k):
    """s as (angular, linear), from P about O before elimination and the body's own inertia.

    Both count, as magnitudes, so that what free wheels or level linear have subtracted from P is included.
    """
    # Diagonals: of P at 0-2 (angular) and 15-17 (linear); of the body's own inertia at 4-6, and its mass at 0.
    P, own = w.body[k].inertia, c.body[k].rigid
    return (
        (sqrt(abs(P[0]) + own[4]), sqrt(abs(P[1]) + own[5]), sqrt(abs(P[2]) + own[6])),
        (sqrt(abs(P[15]) + own[0]), sqrt(abs(P[16]) + own[0]), sqrt(abs(P[17]) + own[0])),
    )


@helper
def _squares(s, h):
    """sum_i s_i^2 h_i^2."""
    total = 0.0
    for i in range(3):
        total += s[0][i] * s[0][i] * h[0][i] * h[0][i] + s[1][i] * s[1][i] * h[1][i] * h[1][i]
    return total


@helper
def _weigh_modes(c, w, x, k, s):
    """x := S'S x for the modes of body k; D_nn before the elimination is recovered from the factors."""
    out = c.body[k].outboard_port
    for n in range(c.body[k].modes):
        size = 0.0
        for i in range(n + 1):
            size += w.pff[k, i, n] * w.pff[k, i, n] * w.inverse_pivot[k, i]
        if out >= 0:
            size += _squares(s, mode_motion(w, out, n))
        x.speed[c.body[k].etad_index + n] *= size


@helper
def _weigh_transfer(c, w, x, k, s):
    """S'S x for the inertia that body k adds to its parent."""
    p, i = c.body[k].parent, c.body[k].inboard_port
    R = _magnitude(mat3(w.body[k].rotation, 0))
    angular, linear = times(R, s[0]), times(R, s[1])
    angular = add(angular, _lever(vec3(w.body[k].arm, 0), linear))
    if i >= 0:
        angular = add(angular, _lever(vec3(w.port[i].r, 0), linear))
        push(c, w, x, p, i, _weighted((angular, linear), port_response(c, w, x, p, i)))
    else:
        add6(x.body[p].force, 0, scale6(-1.0, _weighted((angular, linear), vec6(x.body[p].accel, 0))))


@helper
def _weighted(t, A):
    """t_i^2 A_i."""
    alpha, a = A
    return (
        (t[0][0] * t[0][0] * alpha[0], t[0][1] * t[0][1] * alpha[1], t[0][2] * t[0][2] * alpha[2]),
        (t[1][0] * t[1][0] * a[0], t[1][1] * t[1][1] * a[1], t[1][2] * t[1][2] * a[2]),
    )


@helper
def _magnitude(R):
    return abs(R[0]), abs(R[1]), abs(R[2]), abs(R[3]), abs(R[4]), abs(R[5]), abs(R[6]), abs(R[7]), abs(R[8])


@helper
def _lever(r, f):
    """|r~| f for f >= 0: the cross product r x f with all terms added as magnitudes."""
    x, y, z = abs(r[0]), abs(r[1]), abs(r[2])
    return y * f[2] + z * f[1], z * f[0] + x * f[2], x * f[1] + y * f[0]
