"""Conversions against SciPy and their own inverses; the functions of time of other codes against differences."""

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
from crosscheck.engines.functions_of_time import breaks_between, fastest_rate, profile
from flexmb.scene.functions import Constant, Pulse, Ramp, Sine, SmoothStep, SpinUp, Table

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


_TIMES = tuple(np.linspace(0.0, 4.0, 41))
_SMOOTH = [
    Constant(value=1.5),
    Ramp(value=0.2, rate=-1.1, start_s=0.5),
    Sine(amplitude=0.7, angular_frequency_rad_s=2.3, phase_rad=0.4, offset=-0.2),
    SmoothStep(start_value=-0.5, end_value=1.2, start_s=0.3, duration_s=2.5),
    SpinUp(rate=3.0, duration_s=2.0),
    Table(times_s=_TIMES, values=tuple(np.sin(np.array(_TIMES)))),
]


@pytest.mark.parametrize("function", _SMOOTH, ids=lambda f: type(f).__name__)
def test_rate_and_acceleration_are_the_derivatives(function):
    f, h = profile(function), 1e-3
    for t in np.linspace(0.1, 3.9, 24):
        # Fourth-order central difference: error h^4/30 times the fifth derivative, plus round-off eps/h.
        near = [f(t + k * h) for k in (-2, -1, 1, 2)]
        slope = lambda key, v=near: (getattr(v[0], key) - 8 * getattr(v[1], key) + 8 * getattr(v[2], key) - getattr(v[3], key)) / (12 * h)  # noqa: E501, E731
        assert slope("value") == pytest.approx(f(t).rate, abs=1e-9)
        if not isinstance(function, SpinUp | SmoothStep) or all(abs(t - b) > 3 * h for b in (2.0, 0.3, 2.8)):
            assert slope("rate") == pytest.approx(f(t).acceleration, abs=1e-8)


def test_end_values():
    step = profile(SmoothStep(start_value=-0.5, end_value=1.2, start_s=0.3, duration_s=2.5))
    assert step(0.0) == (-0.5, 0.0, 0.0)
    assert step(9.0).value == pytest.approx(1.2, rel=1e-15)
    spin = profile(SpinUp(rate=3.0, duration_s=2.0))
    assert spin(2.0) == (3.0, 3.0, 0.0)
    assert spin(np.nextafter(2.0, 0.0)).value == pytest.approx(3.0, rel=1e-14)


def test_pulse_is_half_open_and_has_breaks():
    pulse = Pulse(value=2.0, start_s=1.0, duration_s=0.5)
    f = profile(pulse)
    assert [f(t).value for t in (0.999, 1.0, 1.499, 1.5)] == [0.0, 2.0, 2.0, 0.0]
    assert breaks_between([pulse, SpinUp(rate=1.0, duration_s=1.5), Constant(value=1.0)], 0.0, 2.0) == [1.0, 1.5]


def test_table_interpolates_a_quintic_exactly_and_is_undefined_outside():
    t = np.linspace(0.0, 1.0, 8)
    f = profile(Table(times_s=tuple(t), values=tuple(t**5)))
    # round-off of a spline solve with a condition number of order 1e3
    assert f(0.37) == pytest.approx((0.37**5, 5 * 0.37**4, 20 * 0.37**3), rel=1e-11)
    assert np.isnan(f(1.01).value)


@pytest.mark.parametrize("function", _SMOOTH, ids=lambda f: type(f).__name__)
def test_fastest_rate_bounds_the_sampled_rate(function):
    f = profile(function)
    sampled = max(abs(f(t).rate) for t in np.linspace(0.0, 4.0, 801))
    assert sampled <= fastest_rate(function) * (1 + 1e-6)


@pytest.mark.parametrize("function", _SMOOTH, ids=lambda f: type(f).__name__)
def test_what_is_kept_for_a_time_is_of_that_time(function):
    """Engines go back in time when they begin again, and ask twice at the same time."""
    f = profile(function)
    for t in (0.3, 0.3, 1.1, 0.3, 0.0, 1.1):
        assert f(t) == profile(function)(t)
    assert f(0.3) is f(0.3)
