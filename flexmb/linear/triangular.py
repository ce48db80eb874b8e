"""Triangular systems and pivots by BLAS and LAPACK: for few unknowns, SciPy's preparations take ten times as long.

LAPACK's `trtrs`, and all that SciPy builds on it, hands even four unknowns to OpenBLAS's threads, which wait for each
other: 2 us on an idle machine of one core, 30 ms where another process computes. BLAS's `trsm` starts none for so few.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.blas import dtrsm
from scipy.linalg.lapack import dgeqp3

from flexmb.typing import Index, Real

Matrix = NDArray[Any]


def forward(root: Matrix, b: Matrix) -> Matrix:
    """x (n,...) of L x = b, with the factor L (n,n) that `numpy.linalg.cholesky` gives."""
    return _solved(root, b, 1)


def backward(root: Matrix, b: Matrix) -> Matrix:
    """x (n,...) of L' x = b."""
    return _solved(root, b, 0)


def pivots(a: Real) -> Index:
    """The columns of a (m,n) in the order of a QR decomposition with pivots."""
    if not a.size:
        return np.arange(a.shape[1])
    work = dgeqp3(a, lwork=-1)[3]
    order: Index = dgeqp3(a, lwork=int(work[0]))[1]
    return order - 1


def _solved(root: Matrix, b: Matrix, transposed: int) -> Matrix:
    """`root` is lower in rows, to BLAS upper in columns; LinAlgError for a zero on its diagonal."""
    if not b.size:
        return np.empty_like(b)
    singular = np.flatnonzero(root.diagonal() == 0.0)
    if len(singular):
        raise np.linalg.LinAlgError(f"a triangular matrix is singular in row {1 + singular[0]}")
    return np.asarray(dtrsm(1.0, root.T, b, lower=0, trans_a=transposed))
