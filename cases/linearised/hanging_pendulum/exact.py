"""Closed form: small motion of two equal uniform rods that hang one below the other.

By the absolute angles M = m l^2 [[4/3, 1/2], [1/2, 1/3]] and K = m g l diag(3/2, 1/2), with w^2 = (3 +- 6/sqrt(7)) g/l;
the angles of the hinges are the first and the difference of both.
"""

import numpy as np

MASS, LENGTH, GRAVITY = 1.5, 0.8, 9.81  # kg, m, m/s^2


def exact(times):
    """Derivatives of the accelerations (T, 4), row by row, and frequencies (T, 2) rad/s."""
    L = np.array([[1.0, 0.0], [1.0, 1.0]])
    M = MASS * LENGTH**2 * np.array([[4.0 / 3.0, 0.5], [0.5, 1.0 / 3.0]])
    K = MASS * GRAVITY * LENGTH * np.diag([1.5, 0.5])
    by_force = np.linalg.inv(L.T @ M @ L)
    channels = {
        "derivatives.by_displacement": -by_force @ (L.T @ K @ L),
        "derivatives.by_speed": np.zeros((2, 2)),
        "derivatives.by_force": by_force,
        "frequencies": np.sqrt((3.0 + np.array([-6.0, 6.0]) / np.sqrt(7.0)) * GRAVITY / LENGTH),
    }
    return {name: np.tile(values.ravel(), (len(times), 1)) for name, values in channels.items()}
