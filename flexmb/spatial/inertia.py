"""Spatial inertias as scalar tuples: symmetric 6x6 matrices [[A, B], [B', C]], angular block first.

Stored as 21 numbers: A (6, symmetric), B (9), C (6, symmetric). With V = [w; v] at a point, 2T = V' P V.
"""

from flexmb.jit.kernel import helper
from flexmb.spatial.vector import (
    add,
    add9,
    add_sym,
    mat3,
    rotate_mat,
    rotate_plane,
    rotate_rows,
    rotate_sym,
    store9,
    store_sym,
    sym6,
    sym_add,
    sym_times,
    times,
    times_t,
    transpose,
)


@helper
def load_inertia(a, i):
    """Elements i .. i+20 of a 1-D array."""
    return sym6(a, i), mat3(a, i + 6), sym6(a, i + 15)


@helper
def store_inertia(a, i, p):
    store_sym(a, i, p[0])
    store9(a, i + 6, p[1])
    store_sym(a, i + 15, p[2])


@helper
def add_inertia(a, i, p):
    add_sym(a, i, p[0])
    add9(a, i + 6, p[1])
    add_sym(a, i + 15, p[2])


@helper
def sum_inertia(p, q):
    """P + Q."""
    b, d = p[1], q[1]
    middle = (
        b[0] + d[0],
        b[1] + d[1],
        b[2] + d[2],
        b[3] + d[3],
        b[4] + d[4],
        b[5] + d[5],
        b[6] + d[6],
        b[7] + d[7],
        b[8] + d[8],
    )
    return sym_add(p[0], q[0]), middle, sym_add(p[2], q[2])


@helper
def rigid_inertia(m, s, j):
    """Spatial inertia of a rigid body: mass m, first moment s = m c, inertia j (6) about the reference point."""
    return j, (0.0, -s[2], s[1], s[2], 0.0, -s[0], -s[1], s[0], 0.0), (m, m, m, 0.0, 0.0, 0.0)


@helper
def add_rigid(p, m, s, j):
    """P + rigid_inertia(m, s, j), without its zeros."""
    a, b, c = p
    x, y, z = s
    middle = (b[0], b[1] - z, b[2] + y, b[3] + z, b[4], b[5] - x, b[6] - y, b[7] + x, b[8])
    return sym_add(a, j), middle, (c[0] + m, c[1] + m, c[2] + m, c[3], c[4], c[5])


@helper
def rotate_inertia(r, p):
    """Components in axes A from components in axes B with r = R_AB."""
    return rotate_sym(r, p[0]), rotate_mat(r, p[1]), rotate_sym(r, p[2])


@helper
def rotate_without(r, p, row):
    """`rotate_inertia` for an inertia whose row and column 2 (rotation about z) or 5 (translation along z) vanish.

    The vanishing elements are not read.
    """
    a, b, c = p
    if row == 2:
        return rotate_plane(r, a), rotate_rows(r, b), rotate_sym(r, c)
    return rotate_sym(r, a), transpose(rotate_rows(r, transpose(b))), rotate_plane(r, c)


@helper
def _plus_cross_sym(b, p, c):
    """B + skew(p) C for a symmetric 6-tuple C."""
    x, y, z = p
    return (
        b[0] + y * c[4] - z * c[3],
        b[1] + y * c[5] - z * c[1],
        b[2] + y * c[2] - z * c[5],
        b[3] + z * c[0] - x * c[4],
        b[4] + z * c[3] - x * c[5],
        b[5] + z * c[4] - x * c[2],
        b[6] + x * c[3] - y * c[0],
        b[7] + x * c[1] - y * c[3],
        b[8] + x * c[5] - y * c[4],
    )


@helper
def shift_inertia(p, d):
    """phi P phi': the inertia about Q from that about O; d leads from Q to O (same axes).

    C_Q = C, B_Q = B + skew(d) C, A_Q = A - B_Q skew(d) - (B skew(d))'.
    """
    a, b, c = p
    x, y, z = d
    q = _plus_cross_sym(b, d, c)
    about = (
        a[0] - (b[1] + q[1]) * z + (b[2] + q[2]) * y,
        a[1] - (b[5] + q[5]) * x + (b[3] + q[3]) * z,
        a[2] - (b[6] + q[6]) * y + (b[7] + q[7]) * x,
        a[3] - b[4] * z + b[5] * y - q[2] * x + q[0] * z,
        a[4] - b[7] * z + b[8] * y - q[0] * y + q[1] * x,
        a[5] - b[8] * x + b[6] * z - q[3] * y + q[4] * x,
    )
    return about, q, c


@helper
def inertia_times(p, V):
    """P [w; v] as a pair (torque, force)."""
    w, v = V
    return add(sym_times(p[0], w), times(p[1], v)), add(times_t(p[1], w), sym_times(p[2], v))


@helper
def outer_inertia(x, y, s):
    """s [x; y] [x; y]' as a spatial inertia."""
    return (
        (s * x[0] * x[0], s * x[1] * x[1], s * x[2] * x[2], s * x[0] * x[1], s * x[0] * x[2], s * x[1] * x[2]),
        (
            s * x[0] * y[0],
            s * x[0] * y[1],
            s * x[0] * y[2],
            s * x[1] * y[0],
            s * x[1] * y[1],
            s * x[1] * y[2],
            s * x[2] * y[0],
            s * x[2] * y[1],
            s * x[2] * y[2],
        ),
        (s * y[0] * y[0], s * y[1] * y[1], s * y[2] * y[2], s * y[0] * y[1], s * y[0] * y[2], s * y[1] * y[2]),
    )


@helper
def less_outer(p, gain, force):
    """P - gain force', symmetric because gain and force are parallel: the elimination of a hinge with a single axis."""
    (a, b, c), (u, v), (x, y) = p, gain, force
    angular = (
        a[0] - u[0] * x[0], a[1] - u[1] * x[1], a[2] - u[2] * x[2],
        a[3] - u[0] * x[1], a[4] - u[0] * x[2], a[5] - u[1] * x[2],
    )  # fmt: skip
    coupling = (
        b[0] - u[0] * y[0], b[1] - u[0] * y[1], b[2] - u[0] * y[2],
        b[3] - u[1] * y[0], b[4] - u[1] * y[1], b[5] - u[1] * y[2],
        b[6] - u[2] * y[0], b[7] - u[2] * y[1], b[8] - u[2] * y[2],
    )  # fmt: skip
    linear = (
        c[0] - v[0] * y[0], c[1] - v[1] * y[1], c[2] - v[2] * y[2],
        c[3] - v[0] * y[1], c[4] - v[0] * y[2], c[5] - v[1] * y[2],
    )  # fmt: skip
    return angular, coupling, linear


@helper
def add_product(a, i, s, x, y):
    """Add s x y' of 6-vectors x, y to the spatial inertia in a.

    Only the stored elements of x y' are added; the sum over all terms must be symmetric.
    """
    for n in range(3):
        a[i + n] += s * x[n] * y[n]
        a[i + 15 + n] += s * x[3 + n] * y[3 + n]
        for m in range(3):
            a[i + 6 + 3 * n + m] += s * x[n] * y[3 + m]
    a[i + 3] += s * x[0] * y[1]
    a[i + 4] += s * x[0] * y[2]
    a[i + 5] += s * x[1] * y[2]
    a[i + 18] += s * x[3] * y[4]
    a[i + 19] += s * x[3] * y[5]
    a[i + 20] += s * x[4] * y[5]


@helper
def inertia_column(p, j):
    """Column j of the 6x6 matrix as (torque, force)."""
    a, b, c = p
    if j == 0:
        return (a[0], a[3], a[4]), (b[0], b[1], b[2])
    if j == 1:
        return (a[3], a[1], a[5]), (b[3], b[4], b[5])
    if j == 2:
        return (a[4], a[5], a[2]), (b[6], b[7], b[8])
    if j == 3:
        return (b[0], b[3], b[6]), (c[0], c[3], c[4])
    if j == 4:
        return (b[1], b[4], b[7]), (c[3], c[1], c[5])
    return (b[2], b[5], b[8]), (c[4], c[5], c[2])
