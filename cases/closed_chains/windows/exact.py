"""Five windows: all uprights turn as one pendulum, theta'' = -w^2 cos(theta), by the energy integral."""

import numpy as np
from scipy.special import ellipj, ellipk

COUNT, SPEED, GRAVITY = 5, 1.0, 9.81
INERTIA = (COUNT + 1) / 3.0 + COUNT  # kg m^2: bars of 1 m and 1 kg, uprights turn and upper bars move in circles
WEIGHT = GRAVITY * (0.5 * (COUNT + 1) + COUNT)  # N m


def exact(times):
    """Motion of the last upper corner and energies at `times` (s), World axes, SI."""
    fallen, rate = over_the_top(times)
    angle, zero = 0.5 * np.pi - fallen, np.zeros_like(times)
    return {
        "marker:corner.position": np.column_stack([COUNT + np.cos(angle), np.sin(angle), zero]),
        "marker:corner.velocity": rate[:, None] * np.column_stack([np.sin(angle), -np.cos(angle), zero]),
        "marker:corner.angular_velocity": np.column_stack([zero, zero, -rate]),
        "energy.kinetic": 0.5 * INERTIA * rate**2,
    }


def over_the_top(times):
    """Angle fallen from upright, and its rate: rate^2 = SPEED^2 + 4 w^2 sin^2(angle/2), turning over and over.

    From the lowest position psi = angle - pi, it is a pendulum that circulates: sin(psi/2) = sn(v t / k', k'), with
    v = rate/2 there and k' = w/v < 1.
    """
    w2 = WEIGHT / INERTIA
    v = 0.5 * np.sqrt(SPEED**2 + 4.0 * w2)
    m = w2 / v**2
    phase = v * times - ellipk(m)  # psi = -pi at the start
    _, _, dn, amplitude = ellipj(phase, m)
    return 2.0 * amplitude + np.pi, 2.0 * v * dn
