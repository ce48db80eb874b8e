"""Symmetric eigenproblems in numpy alone: their equations, and SciPy's answers."""

import numpy as np
import pytest
import scipy.linalg

from flexmb.modal.eigenproblem import eigenpairs, forward, solve_definite

RNG = np.random.default_rng(3)
SIZES = (1, 2, 7, 40)


def definite(n: int) -> np.ndarray:
    half = RNG.normal(size=(n, n))
    return half @ half.T + n * np.eye(n)


def rounding(n: int) -> float:
    """Of a chain of n^2 sums of products of numbers near one, well conditioned."""
    return n * n * 64 * np.finfo(float).eps


@pytest.mark.parametrize("n", SIZES)
def test_the_equations(n):
    a, b = RNG.normal(size=(n, n)), definite(n)
    a = a + a.T
    values, X = eigenpairs(a, b)
    assert np.all(np.diff(values) >= 0.0)
    assert np.allclose(X.T @ b @ X, np.eye(n), rtol=0.0, atol=rounding(n))
    assert np.allclose(a @ X, b @ X * values, rtol=0.0, atol=rounding(n) * np.linalg.norm(a, 2))
    expected = scipy.linalg.eigh(a, b, eigvals_only=True)
    assert np.allclose(values, expected, rtol=0.0, atol=rounding(n) * np.linalg.norm(a, 2))


@pytest.mark.parametrize("n", SIZES)
def test_substitution_is_that_of_a_triangle(n):
    """Also where the triangle has small pivots, which a solver that exchanges rows would not take."""
    L = np.tril(RNG.normal(size=(n, n)))
    L[np.diag_indices(n)] = 10.0 ** RNG.uniform(-3.0, 0.0, n)
    b = RNG.normal(size=(n, 3))
    expected = scipy.linalg.solve_triangular(L, b, lower=True)
    x = forward(L, b)
    assert np.all(np.abs(L @ x - b) <= 2 * n * np.finfo(float).eps * (np.abs(L) @ np.abs(x)))
    assert np.allclose(L @ x, L @ expected, rtol=0.0, atol=2 * n * np.finfo(float).eps * (np.abs(L) @ np.abs(x)).max())
    a = definite(n)
    assert np.allclose(a @ solve_definite(a, b), b, rtol=0.0, atol=rounding(n))


def test_what_is_not_definite_is_refused():
    indefinite = np.diag([1.0, -1.0])
    with pytest.raises(np.linalg.LinAlgError):
        eigenpairs(np.eye(2), indefinite)
    with pytest.raises(np.linalg.LinAlgError):
        solve_definite(indefinite, np.ones(2))
    with pytest.raises(np.linalg.LinAlgError):
        eigenpairs(np.eye(2), np.full((2, 2), np.nan))
    with pytest.raises(np.linalg.LinAlgError):
        eigenpairs(np.diag([1.0, np.inf]), np.eye(2))
