"""The drives of a planar arm whose two joints follow sines: the textbook's inverse dynamics."""

import numpy as np

MASSES, LENGTHS, GRAVITY = (3.0, 2.0), (0.6, 0.5), 9.81
SINES = ((0.9, 1.5), (1.2, 2.5))  # amplitude, frequency


def exact(times):
    """Motion of the tip, drives and kinetic energy at `times` (s), World axes, SI."""
    (q1, v1, a1), (q2, v2, a2) = (motion(times, *sine) for sine in SINES)
    (m1, m2), (l1, l2) = MASSES, LENGTHS
    I1, I2, c1, c2 = m1 * l1**2 / 3.0, m2 * l2**2 / 3.0, 0.5 * l1, 0.5 * l2
    mixed = m2 * l1 * c2 * np.cos(q2)
    M11, M12 = I1 + I2 + m2 * l1**2 + 2.0 * mixed, I2 + mixed
    bend = m2 * l1 * c2 * np.sin(q2)
    weight = m2 * GRAVITY * c2 * np.cos(q1 + q2)
    arm, tip = direction(q1), direction(q1 + q2)
    along, across = l1 * arm + l2 * tip, l1 * v1[:, None] * turned(arm) + l2 * (v1 + v2)[:, None] * turned(tip)
    return {
        "marker:tip.position": along,
        "marker:tip.velocity": across,
        "drive:shoulder": M11 * a1 + M12 * a2 - bend * (2.0 * v1 + v2) * v2
        + (m1 * c1 + m2 * l1) * GRAVITY * np.cos(q1) + weight,
        "drive:elbow": M12 * a1 + I2 * a2 + bend * v1**2 + weight,
        "energy.kinetic": 0.5 * M11 * v1**2 + M12 * v1 * v2 + 0.5 * I2 * v2**2,
    }


def motion(times, amplitude, w):
    """Angle, rate and acceleration."""
    sine = amplitude * np.sin(w * times)
    return sine, amplitude * w * np.cos(w * times), -(w**2) * sine


def direction(angle):
    return np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)


def turned(vectors):
    return np.cross([0.0, 0.0, 1.0], vectors)
