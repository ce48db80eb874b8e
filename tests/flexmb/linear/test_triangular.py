"""Matrices of few unknowns: beside NumPy's general solutions, and without the threads of BLAS."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import lapack, qr

from flexmb.linear import triangular
from flexmb.linear.triangular import backward, factor, forward, pivots, singular


@pytest.mark.parametrize("n", [1, 4, 9, 30])
@pytest.mark.parametrize("columns", [None, 1, 7])
def test_solutions_are_those_of_a_general_solver(n: int, columns: int | None) -> None:
    draw = np.random.default_rng(n)
    square = draw.standard_normal((n, n))
    root = np.linalg.cholesky(square @ square.T + n * np.eye(n))
    b = draw.standard_normal(n if columns is None else (n, columns))
    for solve, matrix in ((forward, root), (backward, root.T)):
        x = solve(root, b)
        assert x.shape == b.shape
        rounding = 4 * n * np.finfo(float).eps * np.abs(matrix).sum() * abs(x).max()
        np.testing.assert_allclose(matrix @ x, b, atol=rounding)


@pytest.mark.parametrize("n", [0, 1, 4, 9, 60])
def test_factors_are_those_of_numpy(n: int) -> None:
    square = np.random.default_rng(n).standard_normal((n, n))
    mass = square @ square.T + n * np.eye(n)
    root = factor(mass)
    np.testing.assert_allclose(root, np.linalg.cholesky(mass), rtol=1e-12, atol=1e-12)
    assert root.shape == (n, n) and not np.triu(root, 1).any()


@pytest.mark.parametrize(("m", "n"), [(0, 4), (3, 4), (4, 3), (9, 40)])
def test_singular_values_and_the_null_space(m: int, n: int) -> None:
    a = np.random.default_rng(n).standard_normal((m, n))
    values, turned = singular(a)
    np.testing.assert_allclose(values, np.linalg.svd(a, compute_uv=False), rtol=1e-12)
    np.testing.assert_allclose(turned @ turned.T, np.eye(n), atol=1e-13)
    assert abs(a @ turned[m:].T).max(initial=0.0) < 1e-13
    assert m == 0 or abs(a @ turned[:m].T).max() > 0.1  # a control: the others are not in it


@pytest.mark.parametrize("n", [3, 40, 90])
def test_pivots_are_those_of_scipy(n: int) -> None:
    a = np.random.default_rng(n).standard_normal((n, n + 5))
    assert pivots(a).tolist() == qr(a, mode="r", pivoting=True)[1].tolist() != list(range(n + 5))


def test_what_has_no_factor_is_refused() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite in row 2"):
        factor(np.diag([1.0, -1.0]))
    with pytest.raises(np.linalg.LinAlgError, match="singular values"):
        singular(np.full((2, 3), np.nan))


def test_a_zero_on_the_diagonal_is_named_by_its_row() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="singular in row 2"):
        forward(np.array([[1.0, 0.0], [1.0, 0.0]]), np.ones(2))


def test_nothing_here_wakes_the_threads_of_blas() -> None:
    """LAPACK's triangular solver, which does even for four unknowns, is not what is called."""
    assert not {"dtrtrs", "dpotrs", "dgetrs"} & set(vars(triangular))
    assert hasattr(lapack, "dtrtrs")  # it still has that name
