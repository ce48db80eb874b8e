"""Dense symmetric positive definite systems in compiled code: Cholesky by rows, whose inner loops are contiguous."""

from math import sqrt

from flexmb.jit.kernel import helper
from flexmb.spatial.pivots import SINGULAR


@helper
def cholesky_rows(U, n):
    """Cholesky factor U of U' U in place, in the upper triangle of U[:n,:n]; returns -1.

    If the matrix is not positive definite to round-off, or not finite, returns the row of the first such pivot. Two
    rows are computed at a time, from each of which four finished rows are subtracted at once: every number that is
    loaded takes part in two products.
    """
    for m in range(0, n, 2):
        d, floor = U[m, m], SINGULAR * U[m, m]
        for j in range(m):
            d -= U[j, m] * U[j, m]
        if not d > floor:
            return m
        d = sqrt(d)
        U[m, m] = d
        if m + 1 == n:
            return -1
        first, second = U[m, m + 1 : n], U[m + 1, m + 1 : n]
        floor = SINGULAR * second[0]
        j = 0
        while j + 3 < m:
            _subtract_four(U[j : j + 4], m, n, first, second)
            j += 4
        while j < m:
            _subtract(U[j, m], U[j, m + 1 : n], first)
            _subtract(U[j, m + 1], U[j, m + 1 : n], second)
            j += 1
        _scale(1.0 / d, first)
        _subtract(first[0], first, second)
        if not second[0] > floor:
            return m + 1
        _scale(1.0 / sqrt(second[0]), second)
    return -1


@helper
def cholesky_solve(U, x, n):
    """Solve U' U x = b; x[:n] holds b and receives the solution."""
    for m in range(n):
        x[m] /= U[m, m]
        _subtract(x[m], U[m, m + 1 : n], x[m + 1 : n])
    for m in range(n - 1, -1, -1):
        row, s = U[m], x[m]
        for i in range(m + 1, n):
            s -= row[i] * x[i]
        x[m] = s / row[m]


@helper
def _scale(s, y):
    """y *= s."""
    for i in range(y.shape[0]):
        y[i] *= s


@helper
def _subtract(s, a, y):
    """y -= s a."""
    for i in range(y.shape[0]):
        y[i] -= s * a[i]


@helper
def _subtract_four(rows, m, n, y, z):
    """Subtract four finished rows from rows y (m) and z (m + 1), from column m + 1 on.

    In a mass matrix all factors are zero if the rows belong to another branch of the tree: then nothing is done.
    """
    s0, s1, s2, s3 = rows[0, m], rows[1, m], rows[2, m], rows[3, m]
    t0, t1, t2, t3 = rows[0, m + 1], rows[1, m + 1], rows[2, m + 1], rows[3, m + 1]
    if s0 == 0.0 and s1 == 0.0 and s2 == 0.0 and s3 == 0.0 and t0 == 0.0 and t1 == 0.0 and t2 == 0.0 and t3 == 0.0:
        return
    a, b, c, d = rows[0, m + 1 : n], rows[1, m + 1 : n], rows[2, m + 1 : n], rows[3, m + 1 : n]
    for i in range(y.shape[0]):
        y[i] -= s0 * a[i] + s1 * b[i] + s2 * c[i] + s3 * d[i]
        z[i] -= t0 * a[i] + t1 * b[i] + t2 * c[i] + t3 * d[i]
