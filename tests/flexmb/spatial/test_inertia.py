"""Spatial inertias as tuples against dense 6x6 matrices: shifts and rotations are congruences, and form groups."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexmb.jit.kernel import kernel
from flexmb.spatial.inertia import (
    add_inertia,
    inertia_column,
    inertia_times,
    load_inertia,
    outer_inertia,
    rigid_inertia,
    rotate_inertia,
    shift_inertia,
    store_inertia,
    sum_inertia,
)
from flexmb.spatial.spatial_vector import shift_force
from flexmb.spatial.vector import mat3, sym6, vec3
from tests.bounds import gamma
from tests.trees import inertia, vector

# A congruence sums 36 products per entry twice; both routes do so.
DENSE = gamma(2 * 2 * 36)


@kernel
def shifted(a, d, out):
    store_inertia(out, 0, shift_inertia(load_inertia(a, 0), vec3(d, 0)))


@kernel
def rotated(a, R, out):
    store_inertia(out, 0, rotate_inertia(mat3(R, 0), load_inertia(a, 0)))


@kernel
def times(a, V):
    return inertia_times(load_inertia(a, 0), (vec3(V, 0), vec3(V, 3)))


@kernel
def column(a, j):
    return inertia_column(load_inertia(a, 0), j)


@kernel
def outer(V, s, out):
    store_inertia(out, 0, outer_inertia(vec3(V, 0), vec3(V, 3), s))


@kernel
def rigid(m, s, j, out):
    store_inertia(out, 0, rigid_inertia(m, vec3(s, 0), sym6(j, 0)))


@kernel
def moved_force(F, d):
    return shift_force((vec3(F, 0), vec3(F, 3)), vec3(d, 0))


@kernel
def added(a, b, out):
    """Out of place in the first half of `out`, in place in the second."""
    store_inertia(out, 0, sum_inertia(load_inertia(a, 0), load_inertia(b, 0)))
    store_inertia(out, 21, load_inertia(a, 0))
    add_inertia(out, 21, load_inertia(b, 0))


def symmetric(a: np.ndarray) -> np.ndarray:
    return np.array([[a[0], a[3], a[4]], [a[3], a[1], a[5]], [a[4], a[5], a[2]]])


def dense(a: np.ndarray) -> np.ndarray:
    """The 6x6 matrix of 21 numbers: A (xx yy zz xy xz yz), B row by row, C."""
    B = a[6:15].reshape(3, 3)
    return np.block([[symmetric(a[:6]), B], [B.T, symmetric(a[15:])]])


def packed(P: np.ndarray) -> np.ndarray:
    upper = (np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2]))
    return np.concatenate([P[:3, :3][upper], P[:3, 3:].ravel(), P[3:, 3:][upper]])


def cross_matrix(v: np.ndarray) -> np.ndarray:
    return np.cross(v, -np.eye(3))


def shift(d: np.ndarray) -> np.ndarray:
    """phi(d): forces known about O, about Q, with d from Q to O."""
    return np.block([[np.eye(3), cross_matrix(d)], [np.zeros((3, 3)), np.eye(3)]])


@pytest.fixture(params=range(3))
def rng(request):
    return np.random.default_rng(request.param)


def general(rng) -> np.ndarray:
    """An articulated inertia: positive definite, without the structure of a rigid body's."""
    A = rng.normal(size=(6, 6))
    return packed(A @ A.T)


def result(kernel, *arguments) -> np.ndarray:
    out = np.zeros(21)
    kernel(*arguments, out)
    return out


def size(P: np.ndarray, d: np.ndarray) -> float:
    return np.max(np.abs(P)) * (1.0 + np.sum(np.abs(d))) ** 2


def test_shift_is_a_congruence(rng):
    a, d = general(rng), vector(rng, 2.0)
    expected = shift(d) @ dense(a) @ shift(d).T
    assert np.max(np.abs(dense(result(shifted, a, d)) - expected)) <= DENSE * size(dense(a), d)


def test_shifts_add_up(rng):
    a, d, e = general(rng), vector(rng, 2.0), vector(rng, 2.0)
    twice = result(shifted, result(shifted, a, d), e)
    assert np.max(np.abs(twice - result(shifted, a, d + e))) <= 2 * DENSE * size(dense(a), np.append(d, e))


def test_rotation_is_a_congruence(rng):
    a, R = general(rng), Rotation.random(random_state=rng).as_matrix()
    both = np.kron(np.eye(2), R)
    expected = both @ dense(a) @ both.T
    found = dense(result(rotated, a, R.ravel()))
    assert np.max(np.abs(found - expected)) <= DENSE * np.max(np.abs(dense(a))) * 9.0
    back = result(rotated, packed(found), R.T.ravel().copy())
    assert np.max(np.abs(back - a)) <= 2 * DENSE * np.max(np.abs(dense(a))) * 9.0


def test_shift_commutes_with_rotation(rng):
    a, d, R = general(rng), vector(rng, 2.0), Rotation.random(random_state=rng).as_matrix()
    one = result(rotated, result(shifted, a, d), R.ravel())
    other = result(shifted, result(rotated, a, R.ravel()), R @ d)
    assert np.max(np.abs(one - other)) <= 4 * DENSE * size(dense(a), d) * 9.0


def test_momentum_columns_and_sums(rng):
    a, b, V = general(rng), general(rng), rng.normal(size=6)
    P = dense(a)
    assert np.max(np.abs(np.concatenate(times(a, V)) - P @ V)) <= gamma(2 * 6) * np.max(np.abs(P) @ np.abs(V))
    assert np.array_equal(np.array([np.concatenate(column(a, j)) for j in range(6)]).T, P)
    out = np.zeros(42)
    added(a, b, out)
    assert np.array_equal(out[:21], a + b)
    assert np.array_equal(out[21:], a + b)


def test_rank_one_inertia(rng):
    V, s = rng.normal(size=6), -0.7
    expected = s * np.outer(V, V)
    assert np.max(np.abs(dense(result(outer, V, s)) - expected)) <= gamma(4) * np.max(np.abs(expected))


def test_rigid_body_about_any_point_is_shifted_from_its_mass_centre(rng):
    """Steiner: inertia about O of mass m with central inertia J at c is the central one shifted by c."""
    m, c = 1.7, vector(rng, 1.0)
    J = inertia(rng, m, 0.6)
    central = packed(np.block([[J, np.zeros((3, 3))], [np.zeros((3, 3)), m * np.eye(3)]]))
    about_origin = J - m * cross_matrix(c) @ cross_matrix(c)
    steiner = packed(np.block([[about_origin, np.zeros((3, 3))], [np.zeros((3, 3)), np.eye(3)]]))[:6]
    found = result(rigid, m, m * c, steiner)
    assert np.max(np.abs(found - result(shifted, central, c))) <= DENSE * size(dense(central), c)


def test_power_is_the_same_about_every_point(rng):
    """F_Q = phi F_O and V_O = phi' V_Q do the same work."""
    F, V, d = rng.normal(size=6), rng.normal(size=6), vector(rng, 2.0)
    about_q = np.concatenate(moved_force(F, d))
    assert abs(about_q @ V - F @ (shift(d).T @ V)) <= gamma(2 * 12) * np.sum(np.abs(F)) * np.sum(np.abs(V)) * 5.0
    assert np.max(np.abs(about_q - shift(d) @ F)) <= gamma(2 * 6) * np.sum(np.abs(F)) * 5.0
