"""Rotations of frames in numpy alone, against SciPy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from flexmb.scene.quaternions import about, quaternion_of, rotation_matrix

ROUNDING = 8 * np.finfo(float).eps  # the norm, a product and two sums for each element
RNG = np.random.default_rng(5)
HALF_TURNS = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, -1.0], [1.0, 0.0, 0.0, 0.0]])
NEARLY = np.array([[1e-9, 1.0, 0.0, 0.0], [-1e-9, 0.6, 0.8, 0.0], [1.0, 1e-12, 0.0, 0.0]])
ALL = np.concatenate([RNG.normal(size=(200, 4)), HALF_TURNS, NEARLY])


def test_matrices_of_quaternions_of_any_length():
    expected = Rotation.from_quat(ALL, scalar_first=True).as_matrix()
    assert np.allclose(rotation_matrix(ALL), expected, rtol=0.0, atol=ROUNDING)
    assert np.allclose(rotation_matrix(3.0 * ALL), expected, rtol=0.0, atol=ROUNDING)
    assert np.allclose(rotation_matrix(tuple(ALL[0])), expected[0], rtol=0.0, atol=ROUNDING)


def test_quaternions_of_matrices_and_their_signs():
    R = rotation_matrix(ALL)
    expected = Rotation.from_matrix(R).as_quat(scalar_first=True, canonical=True)
    found = quaternion_of(R)
    assert np.allclose(found, expected, rtol=0.0, atol=ROUNDING)
    assert np.allclose(rotation_matrix(found), R, rtol=0.0, atol=ROUNDING)
    assert np.array_equal(quaternion_of(R[7]), found[7])
    assert quaternion_of(R[:0]).shape == (0, 4)


@pytest.mark.parametrize("axis", "xyz")
def test_turns_about_axes(axis):
    for angle in (0.0, 0.3, -2.0, np.pi):
        assert np.allclose(about(axis, angle), Rotation.from_euler(axis, angle).as_matrix(), rtol=0.0, atol=ROUNDING)


def test_the_zero_quaternion_is_refused():
    with pytest.raises(ValueError, match="length zero"):
        rotation_matrix([ALL[0], np.zeros(4)])
