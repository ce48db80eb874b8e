"""Triangular systems and pivots by LAPACK: for few unknowns, SciPy's preparations take ten times as long as it does."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dgeqp3, dtrtrs

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
    """`root` is lower in rows, which to LAPACK is an upper triangle in columns."""
    if not b.size:
        return np.empty_like(b)
    x, info = dtrtrs(root.T, b, lower=0, trans=transposed)
    if info:
        raise np.linalg.LinAlgError(f"a triangular matrix is singular in row {info}")
    return np.asarray(x)
