"""What derivatives and frequencies are known to: the errors of known problems lie within it, and it is not much."""

from __future__ import annotations

import numpy as np
import pytest

from crosscheck.engines.linear.differences import differentiated
from crosscheck.engines.linear.frequencies import eigenfrequencies
from crosscheck.engines.linear.matrices import Errors, LinearMatrices, exact, scaled_condition
from flexmb.typing import Real

SMALL = 1e-13


def spd(rng: np.random.Generator, n: int) -> Real:
    A = rng.normal(size=(n, n))
    return A @ A.T + 0.5 * np.eye(n)


def problem(
    M: Real, K: Real, C: Real | None = None, error: float = SMALL, transport: Real | None = None
) -> LinearMatrices:
    """M q'' + C q' + K q = 0, known to `error`."""
    n, inverse = len(M), np.linalg.inv(M)
    inverse = (inverse + inverse.T) / 2.0
    damping = np.zeros((n, n)) if C is None else C
    turning = np.zeros((n, n)) if transport is None else transport
    return LinearMatrices(-inverse @ K, -inverse @ damping, inverse, turning, Errors(error, error, error))


def test_repeated_frequencies_are_as_good_as_others() -> None:
    rng = np.random.default_rng(1)
    M = spd(rng, 5)
    L = np.linalg.cholesky(M)
    Q = np.linalg.qr(rng.normal(size=(5, 5)))[0]
    right = np.array([1.0, 1.0, 3.0, 3.0, 3.0])
    K = L @ Q @ np.diag(right**2) @ Q.T @ L.T
    found, error = eigenfrequencies(problem(M, (K + K.T) / 2.0))
    assert np.linalg.norm(found - right) <= error <= 1e-11


def test_a_rigid_body_motion_is_zero_and_known_to_the_root_of_rounding() -> None:
    M, K = np.diag([1.0, 2.0]), np.array([[8.0, -8.0], [-8.0, 8.0]])
    found, error = eigenfrequencies(problem(M, K))
    assert found == pytest.approx([0.0, np.sqrt(12.0)], abs=1e-13)
    assert 1e-8 < error < 1e-5


def test_nothing_at_all_that_holds_a_body() -> None:
    found, error = eigenfrequencies(problem(np.eye(2), np.zeros((2, 2)), error=0.0))
    assert np.array_equal(found, [0.0, 0.0]) and error == 0.0


def test_damping_lowers_a_frequency_and_beyond_the_critical_one_there_is_none() -> None:
    K, C = np.diag([4.0, 9.0]), np.diag([1.0, 20.0])
    found, error = eigenfrequencies(problem(np.eye(2), K, C))
    assert found == pytest.approx([0.0, np.sqrt(4.0 - 0.25)], abs=1e-12) and error < 1e-6


def test_a_critically_damped_motion_is_known_to_the_root() -> None:
    """Its double eigenvalue is defective: rounding splits it into a pair that oscillates."""
    found, error = eigenfrequencies(problem(np.eye(1), np.array([[4.0]]), np.array([[4.0]])))
    assert found[0] <= error < 1e-5


def test_gyroscopic_terms_part_a_repeated_frequency() -> None:
    """q'' + g J q' + k q = 0 with J skew has w = sqrt(k + g^2/4) +- g/2."""
    g, k = 0.6, 5.0
    C = g * np.array([[0.0, 1.0], [-1.0, 0.0]])
    found, error = eigenfrequencies(problem(np.eye(2), k * np.eye(2), C))
    right = np.sqrt(k + g**2 / 4.0) + np.array([-g, g]) / 2.0
    assert np.linalg.norm(found - right) <= error <= 1e-11


def test_axes_that_turn_shift_frequencies() -> None:
    """Small motion about a fixed point, with k = 5, in axes that turn by 0.4 about the third: xi' = du - w x xi."""
    turn = 0.4 * np.array([[0.0, 1.0], [-1.0, 0.0]])
    found, error = eigenfrequencies(problem(np.eye(2), 5.0 * np.eye(2), -turn, transport=turn))
    right = np.sqrt(5.0) + np.array([-0.4, 0.4])
    assert np.linalg.norm(found - right) <= error <= 1e-11


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("damped", [False, True], ids=["undamped", "damped"])
def test_matrices_within_their_errors_have_frequencies_within_theirs(seed: int, damped: bool) -> None:
    rng, error = np.random.default_rng(seed), 1e-9
    n = 4
    M, K = spd(rng, n), spd(rng, n)
    C = 0.3 * spd(rng, n) + (lambda A: A - A.T)(rng.normal(size=(n, n))) if damped else None
    true = problem(M, K, C, error)
    right, known = eigenfrequencies(true)
    for _ in range(5):
        change, other = rng.normal(size=(2, n, n))
        if not damped:  # as symmetric as a stiffness is
            change = true.by_force @ (change + change.T)
        moved = LinearMatrices(
            true.by_displacement + error * change / np.linalg.norm(change),
            true.by_speed + (error * other / np.linalg.norm(other) if damped else 0.0),
            true.by_force, true.transport, true.errors,
        )  # fmt: skip
        found, _ = eigenfrequencies(moved)
        assert np.linalg.norm(found - right) <= known <= 1e-6


def test_singular_masses_leave_nothing_known() -> None:
    by_force = np.diag([1.0, -1.0])
    at = exact(np.eye(2), np.eye(2), by_force, np.zeros((2, 2)), np.zeros(2), np.zeros(2))
    assert all(np.isinf(each) for each in (at.errors.by_displacement, at.errors.by_speed, at.errors.by_force))
    found, error = eigenfrequencies(at)
    assert np.array_equal(found, [0.0, 0.0]) and error == np.inf
    assert scaled_condition(np.zeros((2, 2))) == np.inf and scaled_condition(np.full((2, 2), np.nan)) == np.inf


def test_units_do_not_change_the_condition_number() -> None:
    M, scale = spd(np.random.default_rng(2), 4), np.array([1e-6, 1.0, 1e3, 1e8])
    assert scaled_condition(M * np.outer(scale, scale)) == pytest.approx(scaled_condition(M), rel=1e-9)


@pytest.mark.parametrize("rate", [1.0, 20.0, 150.0])
def test_differences_know_their_error(rate: float) -> None:
    """At 150 rad/s a step of 1e-3 is coarse, and the error says so."""

    def f(x: Real) -> Real:
        return np.array([np.sin(rate * x[0]) + np.exp(x[1]), np.cos(rate * x[0]) * (1.0 + x[1])])

    found, error = differentiated(f, 2, 1e-16)
    right = np.array([[rate, 1.0], [0.0, 1.0]])
    assert np.linalg.norm(found - right) <= error <= 1e-2 * rate


def test_differences_of_a_polynomial_are_exact_up_to_noise() -> None:
    noise = 1e-12
    rng = np.random.default_rng(3)
    found, error = differentiated(lambda x: x**4 + 3.0 * x + noise * rng.uniform(-1.0, 1.0, 1), 1, noise)
    assert abs(found[0, 0] - 3.0) <= error <= 1e-8
