"""Angles about carried axes: they turn back into the orientation they were made from, singular or not. Rotations of
frames in numpy alone, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import flexmb as fm
from flexmb.scene.quaternions import SEQUENCES, about, angles_of, quaternion_of, rotation_by, rotation_matrix
from tests.bounds import UNIT_ROUNDOFF

ROUNDING = 64 * UNIT_ROUNDOFF


def turned(sequence: str, angles: np.ndarray) -> np.ndarray:
    first, middle, last = (about(axis, angle) for axis, angle in zip(sequence, angles, strict=True))
    return first @ middle @ last


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_angles_come_back(sequence: str) -> None:
    """Many at once, in any shape; the middle angle in its range, the others in a whole turn."""
    random = np.random.default_rng(7)
    given = random.uniform(-np.pi, np.pi, (5, 8, 3))
    middle = random.uniform(0.05, np.pi - 0.05, (5, 8))
    given[..., 1] = middle if sequence[0] == sequence[2] else middle - np.pi / 2.0
    R = np.array([turned(sequence, angles) for angles in given.reshape(-1, 3)]).reshape(5, 8, 3, 3)
    found = angles_of(quaternion_of(R), sequence)
    assert not found.singular.any()
    np.testing.assert_allclose(found.values, given, atol=100 * ROUNDING)  # the outer ones lose 1 / sin(0.05)


@pytest.mark.parametrize("sequence", SEQUENCES)
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_gimbal_lock_is_said_and_the_orientation_kept(sequence: str, side: float) -> None:
    locked = (0.0 if side < 0 else np.pi) if sequence[0] == sequence[2] else side * np.pi / 2.0
    R = turned(sequence, np.array([0.7, locked, -0.4]))
    found = angles_of(quaternion_of(R), sequence)
    assert found.singular and found.values[2] == 0.0
    np.testing.assert_allclose(turned(sequence, found.values), R, atol=1e-7)  # the root of rounding, as LOCKED says


def test_what_is_no_sequence_is_refused() -> None:
    for wrong in ("zz", "zzx", "xyq", "zyx "):
        with pytest.raises(ValueError, match="not a sequence"):
            angles_of([1.0, 0.0, 0.0, 0.0], wrong)
    with pytest.raises(ValueError, match="length zero"):
        angles_of([0.0, 0.0, 0.0, 0.0])


def test_rotation_vectors() -> None:
    np.testing.assert_allclose(rotation_by([0.0, 0.0, 0.3]), about("z", 0.3), atol=ROUNDING)
    assert np.array_equal(rotation_by(np.zeros((2, 3))), np.broadcast_to(np.eye(3), (2, 3, 3)))


def test_a_marker_turns_on_without_jumps() -> None:
    """Three turns about z in yaw, pitch and roll; the same at one state."""
    scene = (
        fm.SceneBuilder("turntable")
        .rigid_body("table", mass=1.0, inertia=(1.0, 1.0, 1.0))
        .revolute("axle", "ground", "table", axis=(0, 0, 1), rate=2.0 * np.pi)
        .marker("mark", "table")
        .scene()
    )
    system = fm.compile(scene)
    trajectory = fm.simulate(system, 3.0, samples=61)
    yaw, pitch, roll = trajectory.markers["mark"].angles("zyx").values.T
    np.testing.assert_allclose(yaw, 2.0 * np.pi * trajectory.t, atol=1e-8)
    np.testing.assert_allclose([pitch, roll], 0.0, atol=1e-12)
    at = system.evaluate(0.0, trajectory.q[7], trajectory.u[7]).markers["mark"].angles("zyx")
    assert at.values[0] == pytest.approx(np.remainder(yaw[7] + np.pi, 2.0 * np.pi) - np.pi)


PRODUCTS = 8 * np.finfo(float).eps  # the norm, a product and two sums for each element
RNG = np.random.default_rng(5)
HALF_TURNS = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, -1.0], [1.0, 0.0, 0.0, 0.0]])
NEARLY = np.array([[1e-9, 1.0, 0.0, 0.0], [-1e-9, 0.6, 0.8, 0.0], [1.0, 1e-12, 0.0, 0.0]])
ALL = np.concatenate([RNG.normal(size=(200, 4)), HALF_TURNS, NEARLY])


def test_matrices_of_quaternions_of_any_length():
    expected = Rotation.from_quat(ALL, scalar_first=True).as_matrix()
    assert np.allclose(rotation_matrix(ALL), expected, rtol=0.0, atol=PRODUCTS)
    assert np.allclose(rotation_matrix(3.0 * ALL), expected, rtol=0.0, atol=PRODUCTS)
    assert np.allclose(rotation_matrix(tuple(ALL[0])), expected[0], rtol=0.0, atol=PRODUCTS)


def test_quaternions_of_matrices_and_their_signs():
    R = rotation_matrix(ALL)
    expected = Rotation.from_matrix(R).as_quat(scalar_first=True, canonical=True)
    found = quaternion_of(R)
    assert np.allclose(found, expected, rtol=0.0, atol=PRODUCTS)
    assert np.allclose(rotation_matrix(found), R, rtol=0.0, atol=PRODUCTS)
    assert np.array_equal(quaternion_of(R[7]), found[7])
    assert quaternion_of(R[:0]).shape == (0, 4)


@pytest.mark.parametrize("axis", "xyz")
def test_turns_about_axes(axis):
    for angle in (0.0, 0.3, -2.0, np.pi):
        assert np.allclose(about(axis, angle), Rotation.from_euler(axis, angle).as_matrix(), rtol=0.0, atol=PRODUCTS)


def test_the_zero_quaternion_is_refused():
    with pytest.raises(ValueError, match="length zero"):
        rotation_matrix([ALL[0], np.zeros(4)])
