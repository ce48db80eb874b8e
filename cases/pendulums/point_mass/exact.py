"""A simple pendulum released from the horizontal, by Jacobi's elliptic functions: sin(theta/2) = k cd(w t)."""

import numpy as np
from scipy.special import ellipj

MASS, LENGTH, GRAVITY, RELEASE = 1.0, 1.0, 9.81, -0.5 * np.pi


def exact(times):
    """Motion of the mass, load of the pivot, energies and momentum at `times` (s), World axes, SI."""
    w, k = np.sqrt(GRAVITY / LENGTH), np.sin(0.5 * RELEASE)
    sn, cn, dn, _ = ellipj(w * times, k**2)
    half = k * cn / dn  # sin(theta/2)
    sine, cosine = 2.0 * half * np.sqrt(1.0 - half**2), 1.0 - 2.0 * half**2
    rate = -2.0 * k * w * np.sqrt(1.0 - k**2) * sn / dn
    arm, across = plane(sine, -cosine), plane(cosine, sine)
    position, velocity = LENGTH * arm, LENGTH * rate[:, None] * across
    acceleration = -GRAVITY * sine[:, None] * across - LENGTH * (rate**2)[:, None] * arm
    return {
        "marker:tip.position": position,
        "marker:tip.velocity": velocity,
        "marker:tip.angular_velocity": rate[:, None] * np.array([0.0, 0.0, 1.0]),
        "load:pivot.force": MASS * (acceleration + np.array([0.0, GRAVITY, 0.0])),
        "energy.kinetic": 0.5 * MASS * (LENGTH * rate) ** 2,
        "energy.gravity": -MASS * GRAVITY * LENGTH * cosine,
        "momentum.linear": MASS * velocity,
        "momentum.angular": MASS * np.cross(position, velocity),
    }


def plane(x, y):
    return np.stack([x, y, 0.0 * x], axis=1)
