"""Dense symmetric positive definite systems in the compiled code: Cholesky by rows, so that inner loops run on."""

from math import sqrt

from flexmb.kernel import helper

SINGULAR = 2.0**-46  # a pivot this far below its diagonal is what rounding left of a zero: 64 roundings of the diagonal


@helper
def cholesky_rows(U, n):
    """Upper factor of U' U in place of the upper triangle of U[:n,:n]; returns -1.

    Where the matrix is not positive definite to round-off, or not finite, the row of the pivot that shows it. Four
    rows are finished and then taken off all rows below at once. The first column below the diagonal is scratch: it
    keeps the diagonal, which tells what a pivot lost.
    """
    for m in range(1, n):
        U[m, 0] = U[m, m]
    for m in range(n):
        row, first = U[m], m // 4 * 4
        floor = SINGULAR * row[0]
        for j in range(first, m):
            _subtract(U[j, m], U[j], row, m, n)
        if not row[m] > floor:
            return m
        s = 1.0 / sqrt(row[m])
        for i in range(m, n):
            row[i] *= s
        if m == first + 3:
            _subtract_rows(U, first, n)
    return -1


@helper
def cholesky_solve(U, x, n):
    """Solve U' U x = b; x[:n] holds b and receives the solution."""
    for m in range(n):
        x[m] /= U[m, m]
        _subtract(x[m], U[m], x, m + 1, n)
    for m in range(n - 1, -1, -1):
        row, s = U[m], x[m]
        for i in range(m + 1, n):
            s -= row[i] * x[i]
        x[m] = s / row[m]


@helper
def _subtract(s, a, y, start, stop):
    """y -= s a from start to stop; nothing to do between branches of a tree."""
    if s != 0.0:
        for i in range(start, stop):
            y[i] -= s * a[i]


@helper
def _subtract_rows(U, first, n):
    """Take rows first .. first + 3 of the factor off all rows below them."""
    a, b, c, d = U[first], U[first + 1], U[first + 2], U[first + 3]
    for r in range(first + 4, n):
        row = U[r]
        s, t, u, v = a[r], b[r], c[r], d[r]
        if s != 0.0 or t != 0.0 or u != 0.0 or v != 0.0:
            for i in range(r, n):
                row[i] -= s * a[i] + t * b[i] + u * c[i] + v * d[i]
