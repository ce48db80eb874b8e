"""Dense symmetric positive definite systems in the compiled code: Cholesky by rows, so that inner loops run on."""

from math import sqrt

from flexmb.kernel import helper

SINGULAR = 2.0**-46  # a pivot this far below its diagonal is what rounding left of a zero: 64 roundings of the diagonal


@helper
def cholesky_rows(U, n):
    """Upper factor of U' U in place of the upper triangle of U[:n,:n]; returns -1.

    Where the matrix is not positive definite to round-off, or not finite, the row of the pivot that shows it.
    """
    for m in range(n):
        row, floor = U[m, m:n], SINGULAR * U[m, m]
        j = 0
        while j + 3 < m:  # four rows above at a time: the row stays in registers
            _subtract4(U[j : j + 4, m], U[j, m:n], U[j + 1, m:n], U[j + 2, m:n], U[j + 3, m:n], row)
            j += 4
        while j < m:
            _subtract(U[j, m], U[j, m:n], row)
            j += 1
        if not row[0] > floor:
            return m
        s = 1.0 / sqrt(row[0])
        for i in range(row.shape[0]):
            row[i] *= s
    return -1


@helper
def cholesky_solve(U, x, n):
    """Solve U' U x = b; x[:n] holds b and receives the solution."""
    for m in range(n):
        x[m] /= U[m, m]
        _subtract(x[m], U[m, m + 1 : n], x[m + 1 : n])
    for m in range(n - 1, -1, -1):
        for i in range(m + 1, n):
            x[m] -= U[m, i] * x[i]
        x[m] /= U[m, m]


@helper
def _subtract(s, a, y):
    """y -= s a; nothing to do where trees branch."""
    if s != 0.0:
        for i in range(y.shape[0]):
            y[i] -= s * a[i]


@helper
def _subtract4(s, a, b, c, d, y):
    """y -= s0 a + s1 b + s2 c + s3 d."""
    s0, s1, s2, s3 = s[0], s[1], s[2], s[3]
    if s0 != 0.0 or s1 != 0.0 or s2 != 0.0 or s3 != 0.0:
        for i in range(y.shape[0]):
            y[i] -= s0 * a[i] + s1 * b[i] + s2 * c[i] + s3 * d[i]
