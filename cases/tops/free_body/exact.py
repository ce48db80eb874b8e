"""A torque-free asymmetric body: rates by Jacobi's elliptic functions, two of Euler's angles from the moment of
momentum, which is along World z, the third by quadrature."""

import numpy as np
from scipy.special import ellipj

from crosscheck.references.tops import primitive, turn

I1, I2, I3 = 2.0, 3.0, 4.2
MASS = 5.0
W1, W3 = 3.1, 2.0  # rates at the start, where the second is zero
CORNER = np.array([0.5, 0.4, -0.3])
W2 = W1 * np.sqrt(I1 * (I3 - I1) / (I2 * (I3 - I2)))
RATE = W3 * np.sqrt((I3 - I1) * (I3 - I2) / (I1 * I2))
MODULUS = (I2 - I1) * W1 * W2 / (I3 * W3 * RATE)
MOMENTUM = np.hypot(I1 * W1, I3 * W3)


def exact(times):
    """Motion of the corner, energy and momentum at `times` (s), World axes, SI."""
    rates = body_rates(times)
    angles = primitive(precession_rate, times, 8)
    lean = np.arctan2(np.hypot(I1 * rates[0], I2 * rates[1]), I3 * rates[2])
    R = turn(2, angles) @ turn(0, lean) @ turn(2, np.arctan2(I1 * rates[0], I2 * rates[1]))
    omega = np.einsum("tij,jt->ti", R, rates)
    return {
        "marker:corner.position": R @ CORNER,
        "marker:corner.velocity": np.cross(omega, R @ CORNER),
        "marker:corner.angular_velocity": omega,
        "energy.kinetic": 0.5 * np.full(len(times), I1 * W1**2 + I3 * W3**2),
        "momentum.angular": np.tile([0.0, 0.0, MOMENTUM], (len(times), 1)),
    }


def body_rates(times):
    sn, cn, dn, _ = ellipj(RATE * times, MODULUS)
    return np.stack([W1 * cn, W2 * sn, W3 * dn])


def precession_rate(times):
    w1, w2, _ = body_rates(times)
    return MOMENTUM * (I1 * w1**2 + I2 * w2**2) / ((I1 * w1) ** 2 + (I2 * w2) ** 2)
