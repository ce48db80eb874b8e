"""A wheel spun up about a principal axis of a free body: two rates, each changed by the motor's torque alone."""

import numpy as np

BUS, COM, BUS_INERTIA = 20.0, -0.05, 2.5  # the mass centre of both is the origin
WHEEL, PLACE, AXIAL, SPEED = 4.0, 0.25, 0.04, 5.0
TORQUE, FREQUENCY = 0.3, 1.2  # torque (1 - cos(frequency t)) on the wheel
RATE, VELOCITY, ANTENNA = 0.2, np.array([0.1, -0.05, 0.02]), np.array([0.6, 0.5, 0.2])


def exact(times):
    """Motion of the antenna, load of the bearing, energy and momentum at `times` (s), World axes, SI."""
    inertia = BUS_INERTIA + BUS * COM**2 + WHEEL * PLACE**2  # of all but the wheel's spin
    torque = TORQUE * (1.0 - np.cos(FREQUENCY * times))
    impulse = TORQUE * (times - np.sin(FREQUENCY * times) / FREQUENCY)
    twice = TORQUE * (0.5 * times**2 - (1.0 - np.cos(FREQUENCY * times)) / FREQUENCY**2)
    rate, angle, change = RATE - impulse / inertia, RATE * times - twice / inertia, -torque / inertia
    c, s, up = np.cos(angle), np.sin(angle), np.array([0.0, 0.0, 1.0])
    x, y = np.stack([c, s, 0 * c], axis=1), np.stack([-s, c, 0 * c], axis=1)
    arm = ANTENNA[0] * x + ANTENNA[1] * y
    fast = AXIAL * (RATE + SPEED) + impulse  # the wheel's moment of momentum
    mass = BUS + WHEEL
    linear = np.tile(mass * VELOCITY, (len(times), 1))
    return {
        "marker:antenna.position": VELOCITY * times[:, None] + arm + ANTENNA[2] * up,
        "marker:antenna.velocity": VELOCITY + rate[:, None] * np.cross(up, arm),
        "marker:antenna.angular_velocity": rate[:, None] * up,
        "wheel_load:wheel.torque": torque[:, None] * up,
        "wheel_load:wheel.force": WHEEL * PLACE * (change[:, None] * y - (rate**2)[:, None] * x),
        "energy.kinetic": 0.5 * (inertia * rate**2 + fast**2 / AXIAL + mass * VELOCITY @ VELOCITY),
        "momentum.linear": linear,
        "momentum.angular": np.tile((inertia * RATE + AXIAL * (RATE + SPEED)) * up, (len(times), 1)),
    }
