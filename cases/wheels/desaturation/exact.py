"""A wheel braked by viscous friction on a free body under a constant couple, all about one principal axis."""

import numpy as np

BUS, WHEEL, FRICTION, COUPLE = 3.0, 0.05, 0.02, -0.25
RATE, SPEED, ANTENNA = -0.1, 60.0, np.array([0.6, 0.5, 0.2])


def exact(times):
    """Motion of the antenna, torque of the bearing, energy and momentum at `times` (s), World axes, SI."""
    decay = FRICTION * (1.0 / WHEEL + 1.0 / BUS)  # s' = -decay s - couple / bus, s the relative speed
    limit = -COUPLE / (BUS * decay)
    speed = limit + (SPEED - limit) * np.exp(-decay * times)
    path = limit * times - (SPEED - limit) * np.expm1(-decay * times) / decay
    doubly = 0.5 * limit * times**2 + (SPEED - limit) * (times + np.expm1(-decay * times) / decay) / decay
    rate = RATE + (FRICTION * path + COUPLE * times) / BUS
    angle = RATE * times + (FRICTION * doubly + 0.5 * COUPLE * times**2) / BUS
    c, s, up = np.cos(angle), np.sin(angle), np.array([0.0, 0.0, 1.0])
    x, y = np.stack([c, s, 0 * c], axis=1), np.stack([-s, c, 0 * c], axis=1)
    arm = ANTENNA[0] * x + ANTENNA[1] * y
    return {
        "marker:antenna.position": arm + ANTENNA[2] * up,
        "marker:antenna.velocity": rate[:, None] * np.cross(up, arm),
        "marker:antenna.angular_velocity": rate[:, None] * up,
        "wheel_load:wheel.torque": -FRICTION * speed[:, None] * up,
        "energy.kinetic": 0.5 * BUS * rate**2 + 0.5 * WHEEL * (rate + speed) ** 2,
        "momentum.angular": (BUS * rate + WHEEL * (rate + speed))[:, None] * up,
    }
