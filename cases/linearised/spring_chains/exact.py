"""Closed form: chains of equal masses on equal springs, and a body without one.

With the displacement q_j of each mass from the one before it, x = L q with ones in and below the diagonal of L, so that
M = m L'L and K = k 1. The frequencies of a chain of N that is held at one end are 2 sqrt(k/m) sin((2 j - 1) pi / (4 N +
2)).
"""

import numpy as np

MASS, STIFFNESS, DRIFTER, COUNT = 0.7, 40.0, 1.1, 3  # kg, N/m, kg


def exact(times):
    """Derivatives of the accelerations (T, 49), row by row, and frequencies (T, 7) rad/s."""
    L = np.tril(np.ones((COUNT, COUNT)))
    inverse = np.linalg.inv(L.T @ L) / MASS
    by_force = np.zeros((2 * COUNT + 1, 2 * COUNT + 1))
    by_force[:COUNT, :COUNT] = by_force[COUNT : 2 * COUNT, COUNT : 2 * COUNT] = inverse
    by_displacement = -STIFFNESS * by_force
    by_force[-1, -1] = 1.0 / DRIFTER
    j = np.arange(1, COUNT + 1)
    of_chain = 2.0 * np.sqrt(STIFFNESS / MASS) * np.sin((2 * j - 1) * np.pi / (4 * COUNT + 2))
    channels = {
        "derivatives.by_displacement": by_displacement,
        "derivatives.by_speed": np.zeros_like(by_force),
        "derivatives.by_force": by_force,
        "frequencies": np.concatenate([[0.0], np.repeat(of_chain, 2)]),
    }
    return {name: np.tile(values.ravel(), (len(times), 1)) for name, values in channels.items()}
