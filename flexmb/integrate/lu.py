"""LU factorisation with partial pivoting, real or complex, in place: no allocation, and inner loops run along rows."""

from __future__ import annotations

from flexmb.jit.kernel import sweep


@sweep
def lu_factorise(A, pivots):
    """Replace A (n,n) by its factors, P A = L U with L of unit diagonal; `pivots` (n,) are the rows exchanged.

    Returns whether every pivot is finite and not zero.
    """
    n = A.shape[0]
    for m in range(n):
        row = m
        for i in range(m + 1, n):
            if abs(A[i, m]) > abs(A[row, m]):
                row = i
        pivots[m] = row
        size = abs(A[row, m])
        if not 0.0 < size < 1e300:
            return False
        if row != m:
            for j in range(n):
                A[m, j], A[row, j] = A[row, j], A[m, j]
        pivot = A[m]
        inverse = 1.0 / pivot[m]
        for i in range(m + 1, n):
            if A[i, m] != 0.0:
                factor = A[i, m] * inverse
                A[i, m] = factor
                target = A[i]
                for j in range(m + 1, n):
                    target[j] -= factor * pivot[j]
    return True


@sweep
def lu_solve(A, pivots, x):
    """Solve with the factors of `lu_factorise`; x (n,) holds the right side and receives the solution."""
    n = A.shape[0]
    for m in range(n):
        x[m], x[pivots[m]] = x[pivots[m]], x[m]
    for i in range(1, n):
        row, total = A[i], x[i]
        for j in range(i):
            total -= row[j] * x[j]
        x[i] = total
    for i in range(n - 1, -1, -1):
        row, total = A[i], x[i]
        for j in range(i + 1, n):
            total -= row[j] * x[j]
        x[i] = total / row[i]
