"""Dense factors against backward error; the flow of a linear system against closed forms and SciPy's exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from flexmb.integrate.linear_flow import LEVELS, TERMS, Flow, at_fraction, at_quarters, prepare, respond
from flexmb.integrate.lu import lu_factorise, lu_solve
from flexmb.jit.kernel import kernel
from tests.bounds import UNIT_ROUNDOFF, gamma

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
