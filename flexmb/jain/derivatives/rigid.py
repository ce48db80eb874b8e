"""The force of each body's own inertia, and how it changes with s1 and s2: World axes, about the base point.

F = I A + V x* I V. With s2 it changes by I s2. With s1 = (x, y) it changes as by Coriolis forces, whatever y is: the
point at r, which moves with v, has the additional acceleration 2 x x v. With N = sum m r v' and the momentum p,

    change of the torque: 2 sum m r x (x x v) = 2 (tr N - N') x      of the force: 2 x x p
"""

from flexmb.jit.kernel import helper
from flexmb.spatial.cross6 import force_cross
from flexmb.spatial.inertia import inertia_times, rigid_inertia, store_inertia
from flexmb.spatial.spatial_vector import store6, sum6, vec6
from flexmb.spatial.vector import (
    add,
    axpy,
    cross,
    mat3,
    rotate_sym,
    scale,
    sym6,
    times,
    vec3,
)


@helper
def rigid_force(c, d, k):
    """Inertia, `by_rate` and force of a rigid body alone."""
    own = c.body[k].rigid
    R, r, V = mat3(d.body[k].rotation, 0), vec3(d.body[k].position, 0), vec6(d.body[k].velocity, 0)
    m, s = own[0], times(R, vec3(own, 1))
    J = shifted_inertia(m, s, rotate_sym(R, sym6(own, 4)), r)
    s = axpy(m, r, s)
    inertia = rigid_inertia(m, s, J)
    angular, linear = V
    momentum = (
        add(times_sym(J, angular), cross(s, linear)),
        add(scale(m, linear), cross(angular, s)),
    )
    A = vec6(d.body[k].accel, 0)
    F = sum6(inertia_times(inertia, A), force_cross(V, momentum))
    store_inertia(d.body[k].inertia, 0, inertia)
    store6(d.body[k].force, 0, F)
    _store_by_rate(d, k, moved_moments(s, J, V), momentum[1])


@helper
def times_sym(J, v):
    """J v for a symmetric 6-tuple."""
    return (
        J[0] * v[0] + J[3] * v[1] + J[4] * v[2],
        J[3] * v[0] + J[1] * v[1] + J[5] * v[2],
        J[4] * v[0] + J[5] * v[1] + J[2] * v[2],
    )


@helper
def shifted_inertia(m, s, J, r):
    """Inertia about the base point of a body with the first moment s and the inertia J about a point at r."""
    x, y, z = r
    a, b, e = 2.0 * s[0] + m * x, 2.0 * s[1] + m * y, 2.0 * s[2] + m * z
    xx, yy, zz = x * a, y * b, z * e
    return (
        J[0] + yy + zz, J[1] + xx + zz, J[2] + xx + yy,
        J[3] - x * s[1] - y * s[0] - m * x * y,
        J[4] - x * s[2] - z * s[0] - m * x * z,
        J[5] - y * s[2] - z * s[1] - m * y * z,
    )  # fmt: skip


@helper
def moved_moments(s, J, V):
    """N = sum m r v' (9) of a rigid body with first moment s and inertia J about the base point."""
    half = 0.5 * (J[0] + J[1] + J[2])
    xx, yy, zz = half - J[0], half - J[1], half - J[2]
    w, v = V
    first = axpy(s[0], v, cross(w, (xx, -J[3], -J[4])))
    second = axpy(s[1], v, cross(w, (-J[3], yy, -J[5])))
    third = axpy(s[2], v, cross(w, (-J[4], -J[5], zz)))
    return (*first, *second, *third)


@helper
def _store_by_rate(d, k, N, p):
    """2 (tr N - N') and the matrix of 2 x x p, to `by_rate`."""
    D, trace = d.body[k].by_rate, N[0] + N[4] + N[8]
    D[0], D[1], D[2] = 2.0 * (trace - N[0]), -2.0 * N[3], -2.0 * N[6]
    D[3], D[4], D[5] = -2.0 * N[1], 2.0 * (trace - N[4]), -2.0 * N[7]
    D[6], D[7], D[8] = -2.0 * N[2], -2.0 * N[5], 2.0 * (trace - N[8])
    D[9], D[10], D[11] = 0.0, 2.0 * p[2], -2.0 * p[1]
    D[12], D[13], D[14] = -2.0 * p[2], 0.0, 2.0 * p[0]
    D[15], D[16], D[17] = 2.0 * p[1], -2.0 * p[0], 0.0
