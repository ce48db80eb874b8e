"""Closed form: a disc whose mass centre is off an isotropic elastic shaft, which starts to whirl from rest.

With z = x + i y of the shaft's centre: z'' + 2 d z' + w^2 z = e W^2 exp(i W t). The whirl is the particular solution
and the two decaying ones that start it at z = z' = 0.
"""

import numpy as np

MASS, STIFFNESS, DAMPING, ECCENTRICITY = 5.0, 2000.0, 20.0, 0.002  # kg, N/m, N s/m, m
SPIN = 30.0  # rad/s, above the critical speed sqrt(k/m) = 20 rad/s


def exact(times):
    """Position and velocity (T, 3) of the shaft's centre (m, m/s)."""
    whirl, rate = whirling(SPIN, np.asarray(times))
    zero = np.zeros(len(times))
    return {
        "marker:centre.position": np.column_stack([whirl.real, whirl.imag, zero]),
        "marker:centre.velocity": np.column_stack([rate.real, rate.imag, zero]),
    }


def whirling(spin, times):
    """z (m) and its rate (m/s) at the speed `spin` (rad/s)."""
    half, square = 0.5 * DAMPING / MASS, STIFFNESS / MASS
    forced = ECCENTRICITY * spin**2 / (square - spin**2 + 2j * half * spin)
    roots = -half + 1j * np.sqrt(square - half**2) * np.array([1.0, -1.0])
    starts = np.linalg.solve([[1.0, 1.0], roots], [-forced, -1j * spin * forced])
    terms = [(forced, 1j * spin), *zip(starts, roots, strict=True)]
    return sum(a * np.exp(r * times) for a, r in terms), sum(a * r * np.exp(r * times) for a, r in terms)
