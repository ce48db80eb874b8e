"""Points that turn with the deformation: rotations by rotation vectors, with their rates.

With theta(t) the rotation exp(theta~) turns at w = J_l theta', J_l = 1 + A theta~ + B theta~^2 with phi = |theta|,
A = (1 - cos phi)/phi^2 and B = (phi - sin phi)/phi^3: `docs/notation.md`, section 4. Both are series in phi^2, so that
complex vectors are welcome too: an imaginary part that is negligible beside the real one carries a derivative.
"""

from __future__ import annotations

from math import factorial

import numpy as np

from flexmb.modal.cross import cross_matrix
from flexmb.typing import Real

TERMS = 20  # of the series of A and B in phi^2: all digits up to half a turn


def rotation_along(theta: Real) -> Real:
    """R (n,3,3) = exp(theta~) of rotation vectors (n,3) rad, (sin phi)/phi being 1 - B phi^2."""
    square = np.sum(theta * theta, axis=1)
    A, B, T = _series(square, 2)[0], _series(square, 3)[0], cross_matrix(theta)
    return np.asarray(np.eye(3) + (1.0 - B * square)[:, None, None] * T + A[:, None, None] * (T @ T))


def turning(theta: Real, rate: Real, acceleration: Real) -> tuple[Real, Real, Real]:
    """R (n,3,3), angular velocities and accelerations (n,3) of rotation vectors (n,3) rad with their first two rates.

    All in the axes that the vectors turn from.
    """
    square = np.sum(theta * theta, axis=1)
    growth = np.sum(theta * rate, axis=1)  # phi phi'
    (A, A_slope), (B, B_slope) = _series(square, 2), _series(square, 3)
    T, T_rate = cross_matrix(theta), cross_matrix(rate)
    squared = T @ T
    jacobian = np.eye(3) + A[:, None, None] * T + B[:, None, None] * squared
    change = (A_slope * growth)[:, None, None] * T + A[:, None, None] * T_rate
    change += (B_slope * growth)[:, None, None] * squared + B[:, None, None] * (T_rate @ T + T @ T_rate)
    velocity = np.einsum("nab,nb->na", jacobian, rate)
    turning_rate = np.einsum("nab,nb->na", jacobian, acceleration) + np.einsum("nab,nb->na", change, rate)
    return rotation_along(theta), velocity, turning_rate


def _series(square: Real, first: int) -> tuple[Real, Real]:
    """f = sum (-1)^k phi^2k / (2k + first)! and (df/dphi)/phi, of phi^2 (n,)."""
    values = np.array([(-1.0) ** k / factorial(2 * k + first) for k in range(TERMS)])
    slopes = 2.0 * np.arange(1, TERMS) * values[1:]
    return np.polynomial.polynomial.polyval(square, values), np.polynomial.polynomial.polyval(square, slopes)
