"""Conversions against independent code (SciPy) and their own inverses."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.engines.conventions import (
    Frame,
    angular_first,
    axis_rotation,
    cross,
    quaternion_of,
    quaternion_rate,
    rotate_spatial,
    rotation_matrix,
    rotation_vector,
    scalar_first,
    scalar_last,
    shift_wrench,
)  # fmt: skip

EPS = np.finfo(float).eps
CASES = [*np.random.default_rng(0).normal(size=(20, 4)), np.eye(4)[0], np.eye(4)[1], np.eye(4)[2], np.eye(4)[3]]


@pytest.mark.parametrize("q", CASES)
def test_quaternions_agree_with_scipy(q):
    q = q / np.linalg.norm(q)
    R = Rotation.from_quat(scalar_last(q))
    assert rotation_matrix(q) == pytest.approx(R.as_matrix(), abs=8 * EPS)
    assert quaternion_of(R.as_matrix()) @ q == pytest.approx(np.sign(quaternion_of(R.as_matrix()) @ q), abs=8 * EPS)
    if abs(q[0]) > 1e-6:  # at half a turn either sign of the vector is right
        assert rotation_vector(q) == pytest.approx(R.as_rotvec(), abs=32 * EPS)
    assert scalar_first(scalar_last(q)) == pytest.approx(q, abs=0)


def test_axis_rotation_is_right_handed():
    assert axis_rotation((0, 0, 1), 0.3) == pytest.approx(Rotation.from_rotvec([0, 0, 0.3]).as_matrix(), abs=4 * EPS)


def test_quaternion_rate_is_the_derivative_for_outboard_angular_velocity():
    q, w, h = CASES[0] / np.linalg.norm(CASES[0]), np.array([0.3, -0.5, 0.7]), 1e-4
    R = Rotation.from_quat(scalar_last(q))
    ahead, behind = (scalar_first((R * Rotation.from_rotvec(s * h * w)).as_quat()) for s in (1, -1))
    ahead, behind = (each * np.sign(each @ q) for each in (ahead, behind))
    # central difference: h^2/6 |w/2|^3 < 2e-10
    assert quaternion_rate(q, w) == pytest.approx((ahead - behind) / (2 * h), abs=1e-9)


def test_wrench_about_another_point_has_the_same_power():
    rng = np.random.default_rng(1)
    wrench, w, v_o, d = rng.normal(size=6), *rng.normal(size=(3, 3))
    moved = shift_wrench(wrench, d)  # about Q, with d from Q to O
    v_q = v_o - np.cross(w, d)
    assert moved @ np.concatenate([w, v_q]) == pytest.approx(wrench @ np.concatenate([w, v_o]), rel=32 * EPS)
    many = shift_wrench(np.stack([wrench, wrench]), np.stack([d, 0 * d]))
    assert many[0] == pytest.approx(moved) and many[1] == pytest.approx(wrench)


def test_cross_and_orders():
    a, b = np.random.default_rng(2).normal(size=(2, 5, 3))
    assert cross(a, b) == pytest.approx(np.cross(a, b), abs=8 * EPS)
    assert angular_first([1, 2, 3, 4, 5, 6]).tolist() == [4, 5, 6, 1, 2, 3]
    R = axis_rotation((0, 0, 1), np.pi / 2)
    assert rotate_spatial(R, [1, 0, 0, 0, 1, 0]) == pytest.approx([0, 1, 0, -1, 0, 0], abs=EPS)


def test_frames_compose_and_invert():
    rng = np.random.default_rng(3)
    a, b = (Frame(rng.normal(size=3), rotation_matrix(q / np.linalg.norm(q))) for q in CASES[:2])
    p = rng.normal(size=3)
    both = a @ b
    assert both.position + both.rotation @ p == pytest.approx(
        a.position + a.rotation @ (b.position + b.rotation @ p), abs=1e-14
    )
    there_and_back = a @ a.inverse()
    assert there_and_back.position == pytest.approx(np.zeros(3), abs=16 * EPS)
    assert there_and_back.rotation == pytest.approx(np.eye(3), abs=16 * EPS)
