"""sigma - J with the coordinates eliminated first, against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest

from flexmb.integrate import newton_matrix
from flexmb.jit.kernel import kernel
from tests.bounds import gamma

# Sizes of the blocks of J_qq with the number of speeds on which each depends: scalar coordinates, quaternions, a free
# hinge, coordinates without speeds; and what follows the speeds: work, states of a controller.
# The last number is how many blocks there are: neighbouring scalar coordinates count as one.
CHAINS = {
    "scalar": ([(1, 1)] * 5, 1, 1),
    "quaternions": ([(1, 1), (4, 3), (4, 3), (1, 1)], 1, 4),
    "free": ([(7, 6), (1, 1), (1, 1)], 3, 2),
    "held": ([(1, 0), (1, 1), (1, 1), (1, 0)], 1, 3),
    "one block": ([(6, 6)], 1, 1),
    "no coordinates": ([], 4, 0),
}


@kernel
def solve_real(J, coordinates, sigma, x):
    blocks = newton_matrix.rate_blocks(coordinates)
    m = newton_matrix.unfactorised(J.shape[0], coordinates, blocks, np.float64)
    newton_matrix.find_blocks(blocks, J, coordinates)
    regular = newton_matrix.factorise(m, J, sigma)
    if regular:
        newton_matrix.solve(m, J, x)
    return regular, blocks.count[0]


@kernel
def solve_complex(J, coordinates, sigma, x):
    blocks = newton_matrix.rate_blocks(coordinates)
    m = newton_matrix.unfactorised(J.shape[0], coordinates, blocks, np.complex128)
    newton_matrix.find_blocks(blocks, J, coordinates)
    regular = newton_matrix.factorise(m, J, sigma)
    if regular:
        newton_matrix.solve(m, J, x)
    return regular, blocks.count[0]


def jacobian(chain: str, rng: np.random.Generator) -> tuple[np.ndarray, int]:
    """A random J with the zeros of these blocks, and the number of coordinates."""
    blocks, further, _ = CHAINS[chain]
    coordinates, speeds = sum(size for size, _ in blocks), sum(width for _, width in blocks)
    n = coordinates + speeds + further
    J = rng.standard_normal((n, n))
    J[:coordinates] = 0.0
    i, j = 0, coordinates
    for size, width in blocks:
        J[i : i + size, j : j + width] = rng.standard_normal((size, width))
        if size > 1:
            J[i : i + size, i : i + size] = rng.standard_normal((size, size))
        i, j = i + size, j + width
    return J, coordinates


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("sigma", [30.0, 30.0 - 20.0j], ids=["real", "complex"])
def test_solution(chain, sigma):
    """The backward error is that of an LU decomposition, and blocks are found as they are, scalar ones in rows."""
    rng = np.random.default_rng(5)
    J, coordinates = jacobian(chain, rng)
    n, kind = len(J), type(sigma)
    b = rng.standard_normal(n).astype(kind)
    x = b.copy()
    regular, found = (solve_real if kind is float else solve_complex)(J, coordinates, sigma, x)
    assert regular
    assert found == CHAINS[chain][2]
    A = sigma * np.eye(n) - J
    # Higham, Accuracy and Stability (2002), theorem 9.4, twice for the two stages; growth of pivots is within a factor
    # of n here, and complex products round twice.
    bound = 4.0 * gamma(3 * n) * n * (np.abs(A).sum(axis=1).max() * np.abs(x).max() + np.abs(b).max())
    assert np.abs(A @ x - b).max() <= bound


def test_couplings_merge_blocks():
    """A coupling across blocks, in either direction, makes them one: the solution stays right."""
    rng = np.random.default_rng(6)
    for row, column in ((0, 2), (2, 0)):
        J, coordinates = jacobian("scalar", rng)
        J[row, column] = 1.0
        b = rng.standard_normal(len(J))
        x = b.copy()
        regular, found = solve_real(J, coordinates, 30.0, x)
        assert regular
        assert found == 2  # the first three coordinates, and the two others
        np.testing.assert_allclose(30.0 * x - J @ x, b, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("place", [0, -2])
def test_singular(place):
    """An eigenvalue sigma of J, of a coordinate or of what is left, has no factors."""
    J, coordinates = np.zeros((6, 6)), 2
    J[place, place] = 30.0
    regular, _ = solve_real(J, coordinates, 30.0, np.ones(6))
    assert not regular


def test_not_finite():
    """A Jacobian that is not finite has no factors."""
    rng = np.random.default_rng(7)
    for value in (np.nan, np.inf):
        J, coordinates = jacobian("scalar", rng)
        J[-2, -2] = value
        assert not solve_real(J, coordinates, 30.0, np.ones(len(J)))[0]
