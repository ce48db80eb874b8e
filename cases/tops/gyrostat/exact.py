"""A free axisymmetric gyrostat: uniform precession about the moment of momentum, along World z, and uniform spin."""

import numpy as np

from crosscheck.references.tops import turn

ACROSS, ALONG = 2.0, 1.2  # carrier
AXIAL, TRANSVERSE, SPEED = 0.05, 0.03, 120.0  # rotor
RATE_ACROSS, RATE_ALONG = 0.6, 0.4
SENSOR = np.array([0.4, 0.1, 0.3])


def exact(times):
    """Motion of the sensor, bearing torque, energy and momentum at `times` (s), World axes, SI."""
    across, rotor = ACROSS + TRANSVERSE, AXIAL * (RATE_ALONG + SPEED)
    along = ALONG * RATE_ALONG + rotor
    momentum, lean = np.hypot(across * RATE_ACROSS, along), np.arctan2(across * RATE_ACROSS, along)
    precession = momentum / across
    spin = RATE_ALONG - precession * np.cos(lean)
    R = turn(2, precession * times) @ turn(0, np.full_like(times, lean)) @ turn(2, 0.5 * np.pi + spin * times)
    line = turn(2, precession * times) @ np.array([1.0, 0.0, 0.0])
    axis, up = R[:, :, 2], np.array([0.0, 0.0, 1.0])
    omega = precession * up + spin * axis
    aside = np.sin(lean) * np.cross(axis, line)  # omega across the axis, over the precession
    carried = rotor * axis + TRANSVERSE * precession * aside
    energy = 0.5 * (across * RATE_ACROSS**2 + ALONG * RATE_ALONG**2 + rotor * (RATE_ALONG + SPEED))
    return {
        "marker:sensor.position": R @ SENSOR,
        "marker:sensor.velocity": np.cross(omega, R @ SENSOR),
        "marker:sensor.angular_velocity": omega,
        "wheel_load:rotor.torque": np.cross(precession * up, carried),
        "energy.kinetic": np.full_like(times, energy),
        "momentum.angular": np.tile(momentum * up, (len(times), 1)),
    }
