"""Flapping frequencies of a spinning Euler-Bernoulli beam, by Galerkin's method with polynomials of high order.

EI w'''' - (T w')' = m omega^2 w with T = m Omega^2 (L^2 - x^2) / 2, clamped at x = 0 and free at x = L. The shapes are
x^2 times Legendre polynomials, so that Gauss's rule is exact; 30 of them give 12 frequencies to 1e-10.
"""

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh

LENGTH, STIFFNESS, MASS, SPIN = 2.0, 40.0, 0.5, 13.416407864998739  # m, N m^2, kg/m, rad/s
SHAPES, MODES = 30, 12


def exact(times):
    """Frequencies (T, 12) rad/s."""
    nodes, weights = legendre.leggauss(2 * SHAPES + 6)
    x, weights = 0.5 * (nodes + 1.0), 0.5 * weights  # in units of the length
    values, slopes, bends = [], [], []
    for n in range(SHAPES):
        P, P1, P2 = (2.0**k * legendre.legval(nodes, legendre.legder(np.eye(SHAPES)[n], k)) for k in range(3))
        values.append(x**2 * P)
        slopes.append(2.0 * x * P + x**2 * P1)
        bends.append(2.0 * P + 4.0 * x * P1 + x**2 * P2)
    inertia, tension, bending = (
        np.einsum("ik,jk,k->ij", rows, rows, weights * factor)
        for rows, factor in ((np.array(values), 1.0), (np.array(slopes), 0.5 * (1.0 - x**2)), (np.array(bends), 1.0))
    )
    scale = 1.0 / np.sqrt(np.diag(inertia))
    inertia, tension, bending = (part * np.outer(scale, scale) for part in (inertia, tension, bending))
    squares = eigh(STIFFNESS / (MASS * LENGTH**4) * bending + SPIN**2 * tension, inertia, eigvals_only=True)
    return {"frequencies": np.tile(np.sqrt(squares[:MODES]), (len(times), 1))}
