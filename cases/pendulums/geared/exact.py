"""An arm with an armature on a fixed axis: the angle by Jacobi's elliptic functions, the pose and loads from it."""

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk, ellipkinc

MASS, COM, TIP = 1.5, np.array([0.1, 0.05, -0.4]), np.array([0.1, 0.0, -0.8])
INERTIA = np.array([[0.05, 0.004, -0.01], [0.004, 0.06, 0.006], [-0.01, 0.006, 0.02]])
PIVOT, AXIS = np.array([0.0, 0.3, 1.0]), np.array([0.6, 0.8, 0.0])
GRAVITY, ANGLE, RATE = np.array([0.0, 0.0, -9.81]), 1.2, -1.5
ROTOR, RATIO = 2e-5, 100.0


def exact(times):
    """Motion of the tip, load of the shaft on the arm and energy at `times` (s), World axes, SI."""
    about_axis = AXIS @ INERTIA @ AXIS + MASS * np.sum(np.cross(AXIS, COM) ** 2)
    armature = ROTOR * RATIO**2
    down, side = GRAVITY - AXIS * (AXIS @ GRAVITY), np.cross(AXIS, GRAVITY)
    arm = COM - AXIS * (AXIS @ COM)
    start = np.arctan2(arm @ side, arm @ down)  # from the lowest position to that of angle 0
    w = np.sqrt(MASS * np.linalg.norm(arm) * np.linalg.norm(down) / (about_axis + armature))
    theta, rate = swing(times, w, start + ANGLE, RATE)
    turns, acceleration = Rotation.from_rotvec((theta - start)[:, None] * AXIS), -(w**2) * np.sin(theta)
    tip, com, omega, alpha = turns.apply(TIP), turns.apply(COM), rate[:, None] * AXIS, acceleration[:, None] * AXIS
    force = MASS * (np.cross(alpha, com) + np.cross(omega, np.cross(omega, com)) - GRAVITY)
    spin, spun = turns.apply(INERTIA @ AXIS) * rate[:, None], turns.apply(INERTIA @ AXIS) * acceleration[:, None]
    return {
        "marker:tip.position": PIVOT + tip,
        "marker:tip.velocity": np.cross(omega, tip),
        "marker:tip.angular_velocity": omega,
        "load:shaft.force": force,
        "load:shaft.torque": spun + np.cross(omega, spin) + np.cross(com, force),
        "momentum.angular": spin + np.cross(PIVOT + com, MASS * np.cross(omega, com)),
        "energy.kinetic": 0.5 * (about_axis + armature) * rate**2,
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
