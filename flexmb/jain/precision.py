"""How well M is known: what rounding does to its factors M = F F', as a motion meets it.

An articulated inertia P is known to the rounding of what it was summed from before eliminations took from it, however
little they leave: the element i, j to about u s_i s_j, where s_i^2 is a diagonal element before elimination. Handed to
the parent, s becomes t = |phi(arm)| |R| s, for what cancels in a shift is rounded too. In a motion x (nu,) of the
speeds rounding therefore stands for the energy u |S x|^2,

    |S x|^2 = sum over bodies  sum_i t_i^2 A_i^2  +  sum over hinge speeds  sum_i s_i^2 h_i^2 x_j^2
            + sum over modes (D_nn + sum_i s_i^2 Pi_in^2) x_n^2,

A the acceleration of the place on the parent where the body is hinged, h a column of H, Pi_n the motion by mode n of a
node with O on it. M gives it x'M x = |F'x|^2. The largest ratio of the two, kappa = |S F'^-1|^2, is the condition of M
in units that do not matter; u kappa bounds the share of rounding in the accelerations, measured by S. A motion for
which it is 1 has no inertia but rounding.
"""

from flexmb.jain.innovations import innovations, respond
from flexmb.jain.kinematics import motion_column
from flexmb.jain.ports import mode_motion
from flexmb.jain.response import clear_body, port_response, push
from flexmb.jit.kernel import helper
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.spatial_vector import add6, scale6, vec6
from flexmb.spatial.vector import add, mat3, times, vec3


@helper
def weigh(c, w, x):
    """y = F^-1 S'S F'^-1 y of the free speeds, y in x.speed: kappa is the largest eigenvalue of this."""
    respond(c, w, x)
    for k in range(c.body.shape[0]):
        clear_body(c, x, k)
    for k in range(c.body.shape[0]):
        s = _size(c, w, k)
        _weigh_modes(c, w, x, k, s)
        for n in range(c.body[k].nv):
            x.speed[c.body[k].u_index + n] *= _squares(s, motion_column(c, w, k, n))
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            x.speed[c.wheel[i].u_index] *= c.wheel[i].axial
        if c.body[k].parent >= 0:
            _weigh_transfer(c, w, x, k, s)
    innovations(c, w, x)


@helper
def _size(c, w, k):
    """s as (angular, linear): of P about O before elimination, and of the body's own inertia."""
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
    """S'S x of the modes of body k: D_nn from its factors."""
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
    """S'S x of what body k hands to its parent."""
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
    """|r~| f of f >= 0: r x f without cancellation."""
    x, y, z = abs(r[0]), abs(r[1]), abs(r[2])
    return y * f[2] + z * f[1], z * f[0] + x * f[2], x * f[1] + y * f[0]
