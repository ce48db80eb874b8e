"""Rotations: the exponential, its Jacobian and their derivatives, against exact series, SciPy and differentiation."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexmb.jit.kernel import kernel
from flexmb.spatial import rotation
from flexmb.spatial.rotation import (
    exponential,
    exponential_coefficients,
    left_jacobian_rate,
    left_jacobian_times,
    quaternion_rate,
    rotation_vector,
)
from flexmb.spatial.vector import dot
from tests.bounds import gamma
from tests.flexmb import spectral

SPAN = 0.3  # s; the rotation vectors below change by less than 1 rad in it
SWITCH = 0.25  # of t^2, between series and closed form


@kernel
def coefficients(t2):
    return exponential_coefficients(t2)


@kernel
def matrix(theta):
    return exponential(theta, exponential_coefficients(dot(theta, theta)))


@kernel
def jacobian_times(theta, v):
    return left_jacobian_times(theta, exponential_coefficients(dot(theta, theta)), v)


@kernel
def jacobian_rate(theta, v):
    return left_jacobian_rate(theta, exponential_coefficients(dot(theta, theta)), v)


@kernel
def vector_of(w, x, y, z):
    return rotation_vector(w, x, y, z)


@kernel
def matrix_of(w, x, y, z):
    return rotation.quaternion_matrix(w, x, y, z)


@kernel
def axis_matrix(axis, angle):
    return rotation.rotation_axis(axis, angle)


@kernel
def rate_of(w, x, y, z, omega):
    return quaternion_rate(w, x, y, z, omega)


def exact_coefficients(t2: float) -> list[float]:
    """a1, a2, a3, b2, b3 by their power series in rational arithmetic, every digit right."""
    x, one = Fraction(t2), Fraction(1)
    sums, factorial = [Fraction(0)] * 5, [one]
    for n in range(1, 100):
        factorial.append(factorial[-1] * n)
    for k in range(45):
        for m in range(3):
            sums[m] += (-x) ** k / factorial[2 * k + m + 1]
        for m in (2, 3):  # da/dt / t = 2 da/d(t^2)
            sums[m + 1] += -2 * (k + 1) * (-x) ** k / factorial[2 * k + m + 2]
    return [float(value) for value in sums]


@pytest.mark.parametrize("t2", [0.0, 1e-30, 1e-8, 0.01, 0.2, np.nextafter(SWITCH, 0.0), SWITCH, 0.26, 1.0, 4.0, 9.0])
def test_coefficients_against_exact_series(t2):
    """On both sides of the switch to round-off, so that there is no jump.

    The closed forms subtract numbers of size 1 and divide by t^2 (a2, a3) and t^4 (b2, b3); the series do neither.
    """
    p = max(t2, SWITCH)
    bounds = np.array([1.0, 1.0 / p, 1.0 / p, 1.0 / p**2, 1.0 / p**2]) * gamma(16)
    found = np.array(coefficients(t2))
    assert np.all(np.abs(found - exact_coefficients(t2)) <= bounds)
    if t2 < SWITCH:
        assert found[:3] == pytest.approx(exact_coefficients(t2)[:3], rel=gamma(16), abs=0.0)
        assert found[3:] == pytest.approx(exact_coefficients(t2)[3:], rel=1e-14, abs=0.0)  # as its docstring promises


@pytest.mark.parametrize("length", [0.0, 1e-12, 1e-3, 0.4999999, 0.5000001, 1.0, 3.0, np.pi])
def test_exponential_is_the_rotation_of_the_vector(length):
    theta = length * np.array([2.0, -1.0, 2.0]) / 3.0
    R = np.reshape(matrix(tuple(theta)), (3, 3))
    assert np.max(np.abs(R - Rotation.from_rotvec(theta).as_matrix())) <= gamma(32) * (1.0 + length**2)
    assert np.max(np.abs(R @ R.T - np.eye(3))) <= gamma(64) * (1.0 + length**2)


@pytest.mark.parametrize("length", [0.0, 0.1, 0.5, 2.0])
def test_left_jacobian_and_its_rate(length):
    """w = J_l(theta) thetadot and alpha = J_l thetaddot + d/dt(J_l) thetadot for the true rates of exp(theta(t))."""
    start = length * np.array([1.0, 2.0, -2.0]) / 3.0
    rate, acceleration = np.array([0.7, -0.4, 0.9]), np.array([-0.3, 0.8, 0.5])

    def rotated(t: float) -> np.ndarray:
        return np.reshape(matrix(tuple(start + rate * t + 0.5 * acceleration * t * t)), (3, 3))

    R = rotated(0.0)
    first, second = spectral.at_zero(spectral.along(rotated, SPAN), SPAN)
    omega, alpha = vector(first @ R.T), vector(second @ R.T)
    w = np.array(jacobian_times(tuple(start), tuple(rate)))
    a = np.array(jacobian_times(tuple(start), tuple(acceleration))) + jacobian_rate(tuple(start), tuple(rate))
    digits = gamma(32) * (1.0 + length**2)
    assert np.max(np.abs(w - omega)) <= 3.0 * spectral.rounding(SPAN, 1, 1.0, digits)
    assert np.max(np.abs(a - alpha)) <= 3.0 * spectral.rounding(SPAN, 2, 1.0, digits)


def vector(A: np.ndarray) -> np.ndarray:
    """v of the skew part of A."""
    return 0.5 * np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]])


def test_left_jacobian_maps_its_own_axis_to_itself():
    theta = (0.4, -0.3, 1.1)
    assert np.array(jacobian_times(theta, theta)) == pytest.approx(theta, rel=gamma(30))


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-3, 1.0, 3.0, np.pi - 1e-9])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rotation_vector_of_either_sign_of_a_quaternion(angle, sign):
    theta = angle * np.array([-2.0, 1.0, 2.0]) / 3.0
    quaternion = sign * Rotation.from_rotvec(theta).as_quat(scalar_first=True)
    # the angle is 2 atan2(s, w): both good to u, so the vector is to a few u of pi
    assert np.max(np.abs(np.array(vector_of(*quaternion)) - theta)) <= gamma(16) * np.pi


def test_matrix_of_a_quaternion():
    quaternion = Rotation.random(random_state=3).as_quat(scalar_first=True)
    expected = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    assert np.max(np.abs(np.reshape(matrix_of(*quaternion), (3, 3)) - expected)) <= gamma(16)


@pytest.mark.parametrize("axis", range(3))
def test_rotations_about_coordinate_axes(axis):
    expected = Rotation.from_rotvec(0.7 * np.eye(3)[axis]).as_matrix()
    assert np.max(np.abs(np.reshape(axis_matrix(axis, 0.7), (3, 3)) - expected)) <= gamma(8)


def test_quaternion_rate_is_that_of_a_constant_spin_in_turning_axes():
    """q(t) = q0 exp(omega t / 2), differentiated."""
    start, omega = Rotation.random(random_state=4), np.array([0.5, -1.1, 0.8])

    def turned(t: float) -> np.ndarray:
        return (start * Rotation.from_rotvec(omega * t)).as_quat(scalar_first=True)

    q0 = turned(0.0)
    values = spectral.along(lambda t: turned(t) * np.sign(turned(t) @ q0), SPAN)
    rate = spectral.at_zero(values, SPAN)[0]
    assert np.max(np.abs(rate - rate_of(*q0, tuple(omega)))) <= spectral.rounding(SPAN, 1, 1.0, gamma(16))
