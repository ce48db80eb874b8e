"""LU factorisation with partial pivoting, real or complex, in place: no allocation, and inner loops run along rows."""

from __future__ import annotations

from flexmb.jit.kernel import helper, sweep

PANEL = 4  # columns that are eliminated before they are subtracted from the rest of the matrix, all at once


@sweep
def lu_factorise(A, pivots):
    """Replace A (n,n) by its factors, P A = L U with L of unit diagonal; `pivots` (n,) are the rows exchanged.

    Returns whether every pivot is finite and not zero. Each number of the rest of the matrix is loaded and stored once
    for each panel, not for each column.
    """
    n = A.shape[0]
    for m in range(0, n, PANEL):
        stop = min(m + PANEL, n)
        for k in range(m, stop):
            if not _eliminate_in_panel(A, pivots, k, stop):
                return False
        for i in range(m + 1, stop):
            for k in range(m, i):
                _subtract(A[i, k], A[k], A[i], stop)
        if stop < n:
            for i in range(stop, n):
                _subtract_panel(A, m, A[i], stop)
    return True


@helper
def _eliminate_in_panel(A, pivots, k, stop):
    """Column k below its pivot, and its effect on the columns before `stop`; returns whether the pivot is sound."""
    n, row = A.shape[0], k
    for i in range(k + 1, n):
        if abs(A[i, k]) > abs(A[row, k]):
            row = i
    pivots[k] = row
    size = abs(A[row, k])
    if not 0.0 < size < 1e300:
        return False
    if row != k:
        for j in range(n):
            A[k, j], A[row, j] = A[row, j], A[k, j]
    inverse = 1.0 / A[k, k]
    for i in range(k + 1, n):
        if A[i, k] != 0.0:
            factor = A[i, k] * inverse
            A[i, k] = factor
            for j in range(k + 1, stop):
                A[i, j] -= factor * A[k, j]
    return True


@helper
def _subtract(factor, pivot, target, start):
    """target -= factor * pivot, from column `start` on."""
    for j in range(start, target.shape[0]):
        target[j] -= factor * pivot[j]


@helper
def _subtract_panel(A, m, target, start):
    """The same for the four pivots from m on. Rows of another branch of a tree have zeros there: nothing is done."""
    f0, f1, f2, f3 = target[m], target[m + 1], target[m + 2], target[m + 3]
    if f0 == 0.0 and f1 == 0.0 and f2 == 0.0 and f3 == 0.0:
        return
    p0, p1, p2, p3 = A[m], A[m + 1], A[m + 2], A[m + 3]
    for j in range(start, target.shape[0]):
        target[j] -= f0 * p0[j] + f1 * p1[j] + f2 * p2[j] + f3 * p3[j]


@sweep
def lu_solve(A, pivots, x):
    """Solve with the factors of `lu_factorise`; x (n,) holds the right side and receives the solution."""
    n = A.shape[0]
    for m in range(n):
        x[m], x[pivots[m]] = x[pivots[m]], x[m]
    for i in range(1, n):
        x[i] -= product(A[i], x, 0, i)
    for i in range(n - 1, -1, -1):
        x[i] = (x[i] - product(A[i], x, i + 1, n)) / A[i, i]


@helper
def product(row, x, start, stop):
    """Sum of row[j] x[j], in four sums that do not wait for each other."""
    a, b, c, d = 0.0 * x[0], 0.0 * x[0], 0.0 * x[0], 0.0 * x[0]
    whole = start + (stop - start) // 4 * 4
    for j in range(start, whole, 4):
        a += row[j] * x[j]
        b += row[j + 1] * x[j + 1]
        c += row[j + 2] * x[j + 2]
        d += row[j + 3] * x[j + 3]
    for j in range(whole, stop):
        a += row[j] * x[j]
    return (a + b) + (c + d)
