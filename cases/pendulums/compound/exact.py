"""A body on a fixed skew axis: the angle by Jacobi's elliptic functions, the pose from the angle."""

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk, ellipkinc

MASS, COM, CORNER = 2.0, np.array([0.3, -0.1, 0.15]), np.array([0.7, 0.2, 0.3])
INERTIA = np.array([[0.08, 0.01, -0.02], [0.01, 0.12, 0.015], [-0.02, 0.015, 0.1]])
PIVOT, AXIS = np.array([0.2, -0.3, 0.5]), np.array([0.36, 0.48, 0.8])
GRAVITY, ANGLE, RATE = np.array([0.0, 0.0, -9.81]), 0.4, 2.0
MOUNTING = Rotation.from_rotvec(0.8 * np.array([1.0, 2.0, -1.0]) / np.sqrt(6.0))


def exact(times):
    """Motion of the corner, kinetic energy, and the linearised motion at `times` (s), World axes, SI."""
    axis, arm = MOUNTING.apply(AXIS), MOUNTING.apply(COM)
    inertia = AXIS @ INERTIA @ AXIS + MASS * np.sum(np.cross(AXIS, COM) ** 2)
    down, side = GRAVITY - axis * (axis @ GRAVITY), np.cross(axis, GRAVITY)
    arm = arm - axis * (axis @ arm)
    start = np.arctan2(arm @ side, arm @ down)  # from the lowest position to that of angle 0
    w = np.sqrt(MASS * np.linalg.norm(arm) * np.linalg.norm(down) / inertia)
    theta, rate = swing(times, w, start + ANGLE, RATE)
    turns = Rotation.from_rotvec((theta - start)[:, None] * axis)
    corner, omega = turns.apply(MOUNTING.apply(CORNER)), rate[:, None] * axis
    return {
        "marker:corner.position": PIVOT + corner,
        "marker:corner.velocity": np.cross(omega, corner),
        "marker:corner.angular_velocity": omega,
        "energy.kinetic": 0.5 * inertia * rate**2,
        "derivatives.by_displacement": -(w**2) * np.cos(theta),
        "derivatives.by_speed": np.zeros_like(theta),
        "derivatives.by_force": np.full_like(theta, 1.0 / inertia),
        "frequencies": w * np.sqrt(np.maximum(np.cos(theta), 0.0)),
    }


def swing(times, w, angle, rate):
    """Angle and rate of theta'' = -w^2 sin(theta) from its start, which must not go over the top."""
    k = np.sqrt(np.sin(0.5 * angle) ** 2 + (0.5 * rate / w) ** 2)
    assert k < 1.0
    phase = np.copysign(ellipkinc(np.arcsin(min(1.0, abs(np.sin(0.5 * angle)) / k)), k**2), angle)
    if rate < 0.0:
        phase = 2.0 * ellipk(k**2) - phase
    sn, cn, _, _ = ellipj(w * times + phase, k**2)
    return 2.0 * np.arcsin(k * sn), 2.0 * k * w * cn
