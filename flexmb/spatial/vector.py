"""3-vectors and 3x3 matrices as scalar tuples.

With tuples in place of arrays the compiler keeps every component in a register and inlines all calls, so that kernels
read like the equations at no cost. A matrix is a 9-tuple, row by row; a symmetric one a 6-tuple (xx, yy, zz, xy, xz,
yz).
"""

from flexmb.jit.kernel import helper


@helper
def vec3(a, i):
    """Elements i, i+1, i+2 of a 1-D array."""
    return a[i], a[i + 1], a[i + 2]


@helper
def add(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@helper
def sub(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@helper
def scale(s, a):
    return s * a[0], s * a[1], s * a[2]


@helper
def axpy(s, a, b):
    """s a + b."""
    return s * a[0] + b[0], s * a[1] + b[1], s * a[2] + b[2]


@helper
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@helper
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@helper
def plus_cross(a, b, c):
    """a + b x c; in this order each component takes two fused multiply-adds."""
    return a[0] + b[1] * c[2] - b[2] * c[1], a[1] + b[2] * c[0] - b[0] * c[2], a[2] + b[0] * c[1] - b[1] * c[0]


@helper
def mat3(a, i):
    """Elements i .. i+8 of a 1-D array as a matrix."""
    return a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5], a[i + 6], a[i + 7], a[i + 8]


@helper
def times(m, v):
    """M v."""
    return (
        m[0] * v[0] + m[1] * v[1] + m[2] * v[2],
        m[3] * v[0] + m[4] * v[1] + m[5] * v[2],
        m[6] * v[0] + m[7] * v[1] + m[8] * v[2],
    )


@helper
def times_t(m, v):
    """M' v."""
    return (
        m[0] * v[0] + m[3] * v[1] + m[6] * v[2],
        m[1] * v[0] + m[4] * v[1] + m[7] * v[2],
        m[2] * v[0] + m[5] * v[1] + m[8] * v[2],
    )


@helper
def matmul(a, b):
    """A B."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@helper
def transpose(m):
    return m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]


@helper
def sym_times(s, v):
    """S v for a symmetric 6-tuple S."""
    return (
        s[0] * v[0] + s[3] * v[1] + s[4] * v[2],
        s[3] * v[0] + s[1] * v[1] + s[5] * v[2],
        s[4] * v[0] + s[5] * v[1] + s[2] * v[2],
    )


@helper
def sym_full(s):
    """The 9-tuple of a symmetric 6-tuple."""
    return s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2]


@helper
def sym6(a, i):
    """Elements i .. i+5 of a 1-D array as a symmetric matrix."""
    return a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5]


@helper
def sym_add(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@helper
def sym_axpy(s, a, b):
    """s A + B for symmetric 6-tuples."""
    return (
        s * a[0] + b[0],
        s * a[1] + b[1],
        s * a[2] + b[2],
        s * a[3] + b[3],
        s * a[4] + b[4],
        s * a[5] + b[5],
    )


@helper
def sym_dot(a, b):
    """Sum of the six products."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4] + a[5] * b[5]


@helper
def rotate_sym(r, s):
    """R S R' for a symmetric 6-tuple S."""
    t = matmul(r, sym_full(s))
    return (
        t[0] * r[0] + t[1] * r[1] + t[2] * r[2],
        t[3] * r[3] + t[4] * r[4] + t[5] * r[5],
        t[6] * r[6] + t[7] * r[7] + t[8] * r[8],
        t[0] * r[3] + t[1] * r[4] + t[2] * r[5],
        t[0] * r[6] + t[1] * r[7] + t[2] * r[8],
        t[3] * r[6] + t[4] * r[7] + t[5] * r[8],
    )


@helper
def rotate_mat(r, m):
    """R M R'."""
    return matmul(matmul(r, m), transpose(r))


@helper
def rotate_plane(r, s):
    """R S R' for a symmetric 6-tuple S whose row and column z vanish, and are not read."""
    xx, yy, xy = s[0], s[1], s[3]
    ax, ay = r[0] * xx + r[1] * xy, r[0] * xy + r[1] * yy
    bx, by = r[3] * xx + r[4] * xy, r[3] * xy + r[4] * yy
    cx, cy = r[6] * xx + r[7] * xy, r[6] * xy + r[7] * yy
    return (
        ax * r[0] + ay * r[1],
        bx * r[3] + by * r[4],
        cx * r[6] + cy * r[7],
        ax * r[3] + ay * r[4],
        ax * r[6] + ay * r[7],
        bx * r[6] + by * r[7],
    )


@helper
def rotate_rows(r, m):
    """R M R' for a matrix M whose row z vanishes, and is not read."""
    x, y = times(r, (m[0], m[1], m[2])), times(r, (m[3], m[4], m[5]))
    return (
        r[0] * x[0] + r[1] * y[0],
        r[0] * x[1] + r[1] * y[1],
        r[0] * x[2] + r[1] * y[2],
        r[3] * x[0] + r[4] * y[0],
        r[3] * x[1] + r[4] * y[1],
        r[3] * x[2] + r[4] * y[2],
        r[6] * x[0] + r[7] * y[0],
        r[6] * x[1] + r[7] * y[1],
        r[6] * x[2] + r[7] * y[2],
    )


@helper
def store3(a, i, v):
    a[i] = v[0]
    a[i + 1] = v[1]
    a[i + 2] = v[2]


@helper
def add3(a, i, v):
    a[i] += v[0]
    a[i + 1] += v[1]
    a[i + 2] += v[2]


@helper
def store9(a, i, m):
    # without a loop, because the elements may be of different types (floats and duals)
    a[i] = m[0]
    a[i + 1] = m[1]
    a[i + 2] = m[2]
    a[i + 3] = m[3]
    a[i + 4] = m[4]
    a[i + 5] = m[5]
    a[i + 6] = m[6]
    a[i + 7] = m[7]
    a[i + 8] = m[8]


@helper
def add9(a, i, m):
    a[i] += m[0]
    a[i + 1] += m[1]
    a[i + 2] += m[2]
    a[i + 3] += m[3]
    a[i + 4] += m[4]
    a[i + 5] += m[5]
    a[i + 6] += m[6]
    a[i + 7] += m[7]
    a[i + 8] += m[8]


@helper
def store_sym(a, i, s):
    # without a loop, as in store9
    a[i] = s[0]
    a[i + 1] = s[1]
    a[i + 2] = s[2]
    a[i + 3] = s[3]
    a[i + 4] = s[4]
    a[i + 5] = s[5]


@helper
def add_sym(a, i, s):
    a[i] += s[0]
    a[i + 1] += s[1]
    a[i + 2] += s[2]
    a[i + 3] += s[3]
    a[i + 4] += s[4]
    a[i + 5] += s[5]
