"""Matrices of few unknowns by BLAS and LAPACK: the preparations of SciPy and NumPy take three to ten times as long.

LAPACK's `trtrs`, and all that SciPy builds on it, hands even four unknowns to OpenBLAS's threads, which wait for each
other: 2 us on an idle machine of one core, 30 ms where another process computes. BLAS's `trsm` starts none for so few.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dgeqp3, dgesdd, dpotrf

from flexmb.typing import Index, Real

Matrix = NDArray[Any]


BLOCK = 32  # columns that LAPACK takes together: the workspace of a decomposition with pivots has room for them


def factor(mass: Real) -> Real:
    """Cholesky's L (n,n) of a mass matrix; LinAlgError where it is not positive definite."""
    if not mass.size:
        return np.empty_like(mass)
    root, info = dpotrf(mass.T, lower=0)
    if info:
        raise np.linalg.LinAlgError(f"a mass matrix is not positive definite in row {info}")
    return np.asarray(root.T)


def singular(a: Real) -> tuple[Real, Real]:
    """Singular values of a (m,n), and V' (n,n) with the null space last; LinAlgError if they are not found."""
    if not a.size:
        return np.zeros(0), np.eye(a.shape[1])
    _, values, turned, info = dgesdd(a)
    if info:
        raise np.linalg.LinAlgError("singular values were not found: the matrix is not finite, or they do not converge")
    return values, turned


def forward(root: Matrix, b: Matrix) -> Matrix:
    """x (n,...) of L x = b, with Cholesky's factor L (n,n)."""
    return _solved(root, b, 1)


def backward(root: Matrix, b: Matrix) -> Matrix:
    """x (n,...) of L' x = b."""
    return _solved(root, b, 0)


def pivots(a: Real) -> Index:
    """The columns of a (m,n) in the order of a QR decomposition with pivots."""
    if not a.size:
        return np.arange(a.shape[1])
    n = a.shape[1]
    order: Index = dgeqp3(a, lwork=2 * n + BLOCK * (n + 1))[1]
    return order - 1


def _solved(root: Matrix, b: Matrix, transposed: int) -> Matrix:
    """`root` is lower in rows, to BLAS upper in columns; LinAlgError for a zero on its diagonal."""
    if not b.size:
        return np.empty_like(b)
    diagonal = root.diagonal()
    if not diagonal.all():
        row = 1 + int(np.flatnonzero(diagonal == 0.0)[0])
        raise np.linalg.LinAlgError(f"a triangular matrix is singular in row {row}")
    return np.asarray(dtrsm(1.0, root.T, b, lower=0, trans_a=transposed))
