"""Beams with coupled sections by transfer matrices: the exact equations of a Timoshenko beam, integrated along x.

    u' = gamma + theta x e_x      theta' = kappa      [gamma; kappa] = K(x)^-1 [F; M]
    F' = -omega^2 (m u + ...)     M' = -e_x x F - omega^2 (...)

Nothing is shared with the finite elements but K and the inertia of a station, which are written out here.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from flexmb.scene.bodies import BeamStation
from flexmb.typing import Real

# Of a closed section of some centimetres, in SI units: EA, GAy, GAz, GJ, EIy, EIz.
DIAGONAL = np.array([7e7, 2e7, 1.5e7, 1e4, 1.4e4, 3.5e4])
# Correlations between strains, positive definite: bend-twist, extension-bending, shear-twist, bending-bending, ...
CORRELATION = {
    (3, 4): 0.3, (3, 5): -0.2, (0, 5): 0.15, (0, 4): -0.1, (1, 3): 0.2, (2, 3): -0.15, (4, 5): 0.25, (0, 3): 0.1,
}  # fmt: skip
MASS, CENTRE = 2.7, (0.0, 0.01, -0.02)
ABOUT_CENTRE = np.array([[6e-3, 0.0, 0.0], [0.0, 2e-3, -3e-4], [0.0, -3e-4, 4e-3]])


def cross(v: tuple[float, float, float]) -> Real:
    """The matrix of v x."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


AXIS = cross((1.0, 0.0, 0.0))
WINDOW = 1e-4
Along = Callable[[float], Real]


def coupled_stiffness(couplings: dict[tuple[int, int], float] = CORRELATION, diagonal: Real = DIAGONAL) -> Real:
    """A stiffness (6,6) with these correlations."""
    K = np.eye(6)
    for (i, j), value in couplings.items():
        K[i, j] = K[j, i] = value
    size = np.sqrt(diagonal)
    return np.asarray(K * np.outer(size, size))


def section_mass(m: float = MASS, c: tuple[float, float, float] = CENTRE, J: Real = ABOUT_CENTRE) -> Real:
    """The inertia (6,6) per length of mass m at c with J about its centre."""
    return np.block([[m * np.eye(3), -m * cross(c)], [m * cross(c), J - m * cross(c) @ cross(c)]])


def station(x: float, K: Real, M: Real, point: tuple[float, float] = (0.0, 0.0)) -> BeamStation:
    """A station with these matrices."""
    stiffness, inertia = (tuple(map(tuple, each.tolist())) for each in (K, M))
    return BeamStation(x_m=x, stiffness=stiffness, inertia=inertia, reference_point_m=point)


def natural_frequency(near: float, length: float, stiffness: Along, inertia: Along, *, free: bool = False) -> float:
    """The natural frequency (rad/s) of the clamped-free or free-free beam within WINDOW of another one."""
    size = np.sqrt(np.diag(stiffness(0.0)))

    def loads_at_tip(omega: float) -> float:
        """Determinant of the loads at the tip, which vanish together for some motion or load of the root."""
        start = np.zeros((12, 6))
        start[:6] = np.eye(6) * free
        start[6:] = np.diag(size) * (not free)

        def rates(x: float, flat: Real) -> Real:
            motion, load = np.split(flat.reshape(12, 6), 2)
            slope = np.linalg.solve(stiffness(x), load)
            slope[:3] -= AXIS @ motion[3:]
            inertial = -(omega**2) * inertia(x) @ motion
            inertial[3:] -= AXIS @ load[:3]
            return np.concatenate([slope, inertial]).ravel()

        end = solve_ivp(rates, (0.0, length), start.ravel(), method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        loads = end.reshape(12, 6)[6:] / size[:, None]
        return float(np.linalg.det(loads / np.linalg.norm(loads, axis=0)))

    return float(brentq(loads_at_tip, near * (1.0 - WINDOW), near * (1.0 + WINDOW), rtol=1e-13))
