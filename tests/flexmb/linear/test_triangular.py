"""Triangular systems for few unknowns: beside a general solution, and without the threads of BLAS."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import lapack

from flexmb.linear import triangular
from flexmb.linear.triangular import backward, forward


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


def test_a_zero_on_the_diagonal_is_named_by_its_row() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="singular in row 2"):
        forward(np.array([[1.0, 0.0], [1.0, 0.0]]), np.ones(2))


def test_nothing_here_wakes_the_threads_of_blas() -> None:
    """LAPACK's triangular solver, which does even for four unknowns, is not what is called."""
    assert not {"dtrtrs", "dpotrs", "dgetrs"} & set(vars(triangular))
    assert hasattr(lapack, "dtrtrs")  # it still has that name
