"""Names, patterns, distances and ranges of channels."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from crosscheck.engines.contract import MarkerPath, Trajectory
from flexmb.run.channels import channels_of, distance, family, matches, norms, signal_range

T = 5


def test_a_trajectory_becomes_channels_of_one_unit_each() -> None:
    six = np.arange(6.0 * T).reshape(T, 6)
    trajectory = Trajectory(
        status="finished",
        message="",
        times=np.arange(float(T)),
        markers={"tip": MarkerPath(six[:, :3], np.tile([1.0, 0.0, 0.0, 0.0], (T, 1)), six)},
        loads={"elbow": six},
        wheel_loads={"wheel": six},
        drives={"elbow": six[:, :1]},
        energy={"kinetic": np.ones(T), "gravity": 2.0 * np.ones(T)},
        momentum=six,
        work=np.zeros(T),
    )
    channels = channels_of(trajectory)
    assert np.array_equal(channels["load:elbow.torque"], six[:, :3])
    assert np.array_equal(channels["marker:tip.velocity"], six[:, 3:])
    assert np.array_equal(channels["energy.total"], 3.0 * np.ones((T, 1)))
    assert set(channels) == {
        "marker:tip.position", "marker:tip.orientation", "marker:tip.velocity", "marker:tip.angular_velocity",
        "load:elbow.torque", "load:elbow.force", "wheel_load:wheel.torque", "wheel_load:wheel.force", "drive:elbow",
        "energy.kinetic", "energy.gravity", "energy.total", "momentum.angular", "momentum.linear", "work",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("pattern", "channel", "named"),
    [
        ("load", "load:elbow.torque", True),
        ("load:elbow", "load:elbow.torque", True),
        ("load:*.torque", "load:elbow.torque", True),
        ("load:elb", "load:elbow.torque", False),
        ("load", "wheel_load:a.force", False),
        ("energy", "energy.total", True),
        ("marker:*.position", "marker:a.b.position", True),
    ],
)
def test_patterns(pattern: str, channel: str, named: bool) -> None:
    assert matches(pattern, channel) is named


def test_orientation_distance_is_the_angle_whatever_the_sign() -> None:
    angles = np.array([0.0, 1e-9, 0.5, np.pi])
    turned = Rotation.from_rotvec(np.outer(angles, [0.6, 0.0, 0.8])).as_quat()[:, [3, 0, 1, 2]]
    identity = np.tile([1.0, 0.0, 0.0, 0.0], (len(angles), 1))
    for sign in (1.0, -1.0):
        assert distance("marker:a.orientation", sign * turned, identity) == pytest.approx(angles, rel=1e-7)


@pytest.mark.parametrize("number", [np.inf, -np.inf, np.nan])
def test_what_is_not_finite_has_no_finite_distance(number: float) -> None:
    """A quaternion of infinities is no turn by a full angle."""
    sound = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    broken = sound.copy()
    broken[1, 2] = number
    for channel in ("marker:a.orientation", "marker:a.position"):
        there, not_there = distance(channel, broken, sound)
        assert there == 0.0 and not np.isfinite(not_there)


def test_range_of_a_position_does_not_depend_on_the_origin() -> None:
    path = np.column_stack([np.linspace(0.0, 3.0, T), np.zeros(T), np.zeros(T)])
    assert signal_range("marker:a.position", path + 1e6) == pytest.approx(3.0)
    assert signal_range("load:a.force", path + np.array([1.0, 0.0, 0.0])) == pytest.approx(4.0)


def test_families() -> None:
    assert family("load:a.b.torque") == "load.torque"
    assert family("energy.strain") == family("energy.total") == "energy"
    assert family("drive:elbow") == "drive"
    assert family("momentum.linear") == "momentum.linear"


@pytest.mark.parametrize("size", [1e-300, 1e-99, 1.0, 1e99, 1e300])
def test_norms_are_those_of_scaled_rows_whatever_their_size(size: float) -> None:
    """Squares of rows below 1e-154 or beyond 1e154 are lost: a power of two makes them tame, and rounds nothing."""
    rows = np.random.default_rng(3).standard_normal((200, 3)) * size
    rows[::7] = 0.0
    rows[::5, 1] *= 1e-30
    power = 2.0 ** -np.frexp(size)[1]
    assert np.array_equal(norms(rows), np.linalg.norm(rows * power, axis=1) / power)
