"""Linear algebra of the implicit methods: sigma - J with the coordinates eliminated first, dense factors against
backward error, and the flow of a linear system against closed forms and SciPy's exponential."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from flexmb.integrate import newton_matrix
from flexmb.integrate.linear_flow import LEVELS, TERMS, Flow, at_fraction, at_quarters, prepare, respond
from flexmb.integrate.lu import lu_factorise, lu_solve
from flexmb.jit.kernel import kernel
from tests.bounds import UNIT_ROUNDOFF, gamma

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


THETAS = (0.003, 0.25, 0.3, 0.77, 1.0)


@kernel
def solve(A, pivots, x):
    regular = lu_factorise(A, pivots)
    if regular:
        lu_solve(A, pivots, x)
    return regular


@kernel
def flow_at(A, h, v, theta, out):
    """out (n,) = x(theta) of x' = h A x + sum of v[l] theta^l / l!; returns whether the flow could be prepared."""
    n = A.shape[0]
    flow = Flow(
        np.empty((n, n)), np.empty(n), np.empty((LEVELS, n, n)), np.empty((TERMS, n, n)), np.empty((5, n, n)),
        np.empty(1, np.int64),
    )  # fmt: skip
    X, x, term, product = np.empty((LEVELS, TERMS, n)), np.empty((4, n)), np.empty(n), np.empty(n)
    if not prepare(flow, A, h):
        return False
    for l in range(TERMS):
        for i in range(n):
            v[l, i] /= flow.scale[i]
    respond(flow, v, TERMS, X)
    at_quarters(flow, X, x)
    at_fraction(flow, v, X, x, theta, out, term, product)
    for i in range(n):
        out[i] *= flow.scale[i]
    return True


def flow(A, v, theta, h=1.0) -> np.ndarray:
    out = np.empty(len(A))
    assert flow_at(np.array(A, float), h, np.array(v, float), theta, out)
    return out


def by_exponential(Z, v, theta) -> np.ndarray:
    """The same from one exponential of a larger matrix: the powers theta^l / l! are states of their own."""
    n = len(Z)
    B = np.zeros((n + TERMS, n + TERMS))
    B[:n, :n], B[:n, n:] = Z, np.transpose(v)
    B[n + 1 :, n:-1] = np.eye(TERMS - 1)
    return expm(theta * B)[:n, n]


@pytest.mark.parametrize("dtype", [float, complex])
def test_factors_solve_to_rounding(dtype):
    """|b - A x| <= 3 gamma(n) |L| |U| |x| (Higham, theorem 9.4); partial pivoting keeps |L| |U| within n |A| or so."""
    rng = np.random.default_rng(1)
    for n in (1, 2, 7, 30):
        A = (rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-3, 3, (n, 1))).astype(dtype)
        if dtype is complex:
            A += 1j * rng.normal(size=(n, n))
        b = rng.normal(size=n).astype(dtype)
        x = b.copy()
        assert solve(A.copy(), np.empty(n, np.int64), x)
        assert np.all(np.abs(A @ x - b) <= 6 * gamma(n) * n * np.abs(A).max(1) * np.abs(x).max())


def test_singular_and_infinite_matrices_are_refused():
    for A in ([[1, 2], [2, 4]], [[0, 0], [0, 1]], [[np.inf, 0], [0, 1]], [[np.nan, 0], [0, 1]]):
        assert not solve(np.array(A, float), np.empty(2, np.int64), np.ones(2))


@pytest.mark.parametrize("theta", THETAS)
def test_flow_equals_the_exponential_of_the_larger_matrix(theta):
    """Both err by rounding times the norm of Z, which is 30 here."""
    rng = np.random.default_rng(2)
    Z, v = rng.normal(size=(9, 9)), rng.normal(size=(TERMS, 9))
    Z[:, 4] = 0.0  # a quadrature: nothing depends on it
    Z *= 30.0 / np.abs(Z).sum(1).max()
    exact = by_exponential(Z, v, theta)
    assert np.abs(flow(Z, v, theta) - exact).max() < 30 * 9 * 10 * UNIT_ROUNDOFF * np.abs(exact).max()


@pytest.mark.parametrize("theta", THETAS)
def test_slow_motion_keeps_its_digits_beside_fast(theta):
    """Two oscillators, of 1 rad and of 1e6 rad a step: x'' = -w^2 x + 1 from rest is (1 - cos w theta) / w^2.

    The fast one is known as well as its phase, 1e6 u; the slow one to rounding, though 2^24 steps are doubled.
    """
    w = np.array([1.0, 1e6])
    Z = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.diag(w**2), np.zeros((2, 2))]])
    v = np.zeros((TERMS, 4))
    v[0, 2:] = 1.0
    x = flow(Z, v, theta)
    exact = np.r_[2.0 * np.sin(w * theta / 2) ** 2 / w**2, np.sin(w * theta) / w]
    assert np.all(np.abs(x - exact)[[0, 2]] < 60 * UNIT_ROUNDOFF * np.abs(exact)[[0, 2]])
    assert np.all(np.abs(x - exact)[[1, 3]] < 10 * 1e6 * UNIT_ROUNDOFF * np.array([2e-12, 1e-6]))


def test_a_norm_beyond_the_levels_is_refused():
    assert not flow_at(np.array([[1e12]]), 1.0, np.zeros((TERMS, 1)), 1.0, np.empty(1))
    assert not flow_at(np.array([[np.inf]]), 1.0, np.zeros((TERMS, 1)), 1.0, np.empty(1))
