"""Generalised symmetric eigenproblems by numpy alone, because importing SciPy's takes a fifth of a second.

numpy has no triangular solver. Applied to an upper triangular matrix, its general solver exchanges no rows and
eliminates nothing, so that it reduces to back substitution.
"""

from __future__ import annotations

import numpy as np

from flexmb.typing import Real


def eigenpairs(a: Real, b: Real) -> tuple[Real, Real]:
    """Ascending values (n,) and columns X (n,n) of a x = value b x for symmetric a and positive definite b: X'b X = 1.

    LinAlgError if b is not positive definite, or an element is not finite.
    """
    _refuse_infinite(a)
    L = _factor(b)
    reduced = forward(L, forward(L, a).T)
    # Rounding makes `reduced` slightly unsymmetric, and eigh reads one triangle only: average the two.
    values, columns = np.linalg.eigh((reduced + reduced.T) / 2.0)
    return values, np.linalg.solve(L.T, columns)


def refined(a: Real, b: Real, X: Real) -> tuple[Real, Real]:
    """Values (n,) and columns X (n,n) of a x = value b x in the order of approximate ones, with X'b X = 1.

    One step of Newton's method (T. Ogita, K. Aishima, Iterative refinement for symmetric eigenvalue decomposition,
    Japan J. Indust. Appl. Math. 35 (2018) 1007). A reduction to one symmetric matrix errs by rounding errors of its
    largest value; the residuals of single columns do not, so that all columns get all digits, as far as the gaps
    between their values allow.
    """
    lack, energy = np.eye(len(a)) - X.T @ b @ X, X.T @ a @ X
    values = np.diag(energy) / (1.0 - np.diag(lack))
    gap = values - values[:, None]
    apart = np.abs(gap) > _SAME * np.abs(values)
    turn = np.where(apart, (energy + values * lack) / np.where(apart, gap, 1.0), 0.5 * lack)
    return values, X + X @ turn


_SAME = 1e-8
"""Relative difference of values that count as equal: of their columns only the lengths and angles are corrected."""


def solve_definite(a: Real, b: Real) -> Real:
    """a^-1 b for positive definite a, by Cholesky; LinAlgError if a is not, or has elements that are not finite."""
    L = _factor(a)
    return np.linalg.solve(L.T, forward(L, b))


def forward(L: Real, b: Real) -> Real:
    """L^-1 b for lower triangular L, which is upper triangular with rows and columns reversed."""
    return np.linalg.solve(L[::-1, ::-1], b[::-1])[::-1]


def _factor(a: Real) -> Real:
    """Cholesky's factor, lower triangular."""
    _refuse_infinite(a)
    return np.linalg.cholesky(a)


def _refuse_infinite(a: Real) -> None:
    if not np.all(np.isfinite(a)):
        raise np.linalg.LinAlgError("the matrix has elements that are not finite")
