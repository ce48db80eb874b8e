"""Motion of points of carriers, rigid or bending: World position, rotation, velocity and acceleration."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.contract import MarkerPath, MarkerSnapshot
from crosscheck.engines.exudyn.modal import NodeShape
from crosscheck.engines.exudyn.rotations import exponential, left_jacobian, left_jacobian_rate, quaternions
from crosscheck.engines.exudyn.state import CarrierPath
from flexmb.typing import Real


def marker_path(path: CarrierPath, shape: NodeShape, offset: Real) -> MarkerPath:
    """The frame at a node (in Exudyn axes) plus `offset` (3,) in node axes, over all samples."""
    position, rotation, velocity, _ = _motion(path, shape, offset)
    return MarkerPath(position, quaternions(rotation), velocity)


def marker_snapshot(path: CarrierPath, shape: NodeShape, offset: Real) -> MarkerSnapshot:
    """The same at the first sample, with accelerations."""
    position, rotation, velocity, acceleration = _motion(path, shape, offset)
    return MarkerSnapshot(position[0], quaternions(rotation)[0], velocity[0], acceleration[0])


def _motion(path: CarrierPath, shape: NodeShape, offset: Real) -> tuple[Real, Real, Real, Real | None]:
    A, w = path.rotation, path.omega
    theta, theta_rate = path.eta @ shape.rotation_modes.T, path.eta_rate @ shape.rotation_modes.T
    E, J = exponential(theta), left_jacobian(theta)
    arm = E @ (shape.rotation @ offset)  # node to marker, body axes
    s = _times(J, theta_rate)  # angular velocity of the node in the body, body axes
    x = shape.position + path.eta @ shape.translation.T + arm
    x_rate = path.eta_rate @ shape.translation.T + np.cross(s, arm)
    x_World, x_rate_World, s_World = (_times(A, each) for each in (x, x_rate, s))
    position = path.position + x_World
    linear = path.velocity + np.cross(w, x_World) + x_rate_World
    velocity = np.concatenate([w + s_World, linear], axis=1)
    if path.acceleration is None:
        return position, A @ E @ shape.rotation, velocity, None
    s_rate = _times(J, path.eta_acceleration @ shape.rotation_modes.T) + _times(
        left_jacobian_rate(theta, theta_rate), theta_rate
    )
    x_second = path.eta_acceleration @ shape.translation.T + np.cross(s_rate, arm) + np.cross(s, np.cross(s, arm))
    angular = path.alpha + np.cross(w, s_World) + _times(A, s_rate)
    classical = (
        path.acceleration
        + np.cross(path.alpha, x_World)
        + np.cross(w, np.cross(w, x_World))
        + 2.0 * np.cross(w, x_rate_World)
        + _times(A, x_second)
    )
    return position, A @ E @ shape.rotation, velocity, np.concatenate([angular, classical], axis=1)


def _times(A: Real, b: Real) -> Real:
    """(T,3,3) times (T,3)."""
    return np.einsum("tij,tj->ti", A, b)
