"""Closed form: frequencies of a cantilever whose bending and twist are coupled, from its transfer matrix.

With deflection w, rotations theta about y and phi about the axis, force Q, moment M and torque T the beam obeys

    w' = -theta,  theta' = kappa,  phi' = tau,   [T; M] = [GJ, K; K, EI] [tau; kappa]
    Q' = -omega^2 m w,  M' = Q,  T' = -omega^2 I phi

so that y(L) = exp(A L) y(0). The clamp leaves Q, M and T at x = 0, which must give none at x = L.
"""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

LENGTH, MASS, ABOUT_AXIS = 0.1905, 0.0544, 7.77e-7  # m, kg/m, kg m
TORSION, BENDING, COUPLING = 0.1891, 0.2865, 0.1143  # N m^2
MODES, STEP = 6, 25.0  # rad/s, of the search; the frequencies are hundreds apart


def exact(times):
    """Frequencies (T, 6) rad/s."""
    found, omega = [], STEP
    while len(found) < MODES:
        if _loads_at_tip(omega) * _loads_at_tip(omega + STEP) < 0.0:
            found.append(brentq(_loads_at_tip, omega, omega + STEP, xtol=1e-12, rtol=1e-14))
        omega += STEP
    return {"frequencies": np.tile(found, (len(times), 1))}


def _loads_at_tip(omega):
    """Determinant of the loads at the tip by those at the clamp."""
    A = np.zeros((6, 6))  # of [w, theta, phi, Q, M, T]
    compliance = np.linalg.inv([[TORSION, COUPLING], [COUPLING, BENDING]])
    A[0, 1] = -1.0
    A[1, [5, 4]] = compliance[1]
    A[2, [5, 4]] = compliance[0]
    A[3, 0] = -(omega**2) * MASS
    A[4, 3] = 1.0
    A[5, 2] = -(omega**2) * ABOUT_AXIS
    loads = expm(A * LENGTH)[3:, 3:]
    return np.linalg.det(loads / np.linalg.norm(loads, axis=0))
