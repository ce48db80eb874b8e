"""Closed form: the lower mode of Beck's column, a cantilever pressed by a force that stays along its tip.

With x/L, p = P L^2/EI and w^2 = m omega^2 L^4/EI the shape is A (cosh a x - cos b x) + B (sinh a x - (a/b) sin b x),
a^2, b^2 = sqrt(p^2/4 + w^2) -+ p/2; at the tip moment and shear vanish. Their determinant gives w. The column keeps its
length: a point comes down by half the integral of the square of the slope.
"""

import numpy as np
from scipy.optimize import brentq

LENGTH, STIFFNESS, MASS = 2.0, 40.0, 0.5  # m, N m^2, kg/m
UNIT = np.sqrt(STIFFNESS / (MASS * LENGTH**4))  # rad/s
LOAD = 12.0  # P L^2/EI; two modes meet at 20.05
TIP = 1e-4  # m


def exact(times):
    """Position (T, 3) of tip and middle (m)."""
    frequency, shape, slope = lower_mode()
    phase, zero = np.cos(frequency * UNIT * times), np.zeros(len(times))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    channels = {}
    for name, place in {"tip": 1.0, "middle": 0.5}.items():
        steepness = 0.5 * place * weights @ slope(0.5 * place * (nodes + 1.0)) ** 2 / LENGTH
        down = place * LENGTH - 0.5 * steepness * phase**2
        channels[f"marker:{name}.position"] = np.column_stack([down, shape(place) * phase, zero])
    return channels


def lower_mode():
    """w, and deflection and slope times L (m) over x/L, of the lower mode."""
    frequency = brentq(lambda w: np.linalg.det(_tip(w)), 3.0, 7.0, xtol=1e-15)
    a, b = _exponents(frequency)
    moment = _tip(frequency)[0]
    A, B = moment[1], -moment[0]

    def shape(x):
        return A * (np.cosh(a * x) - np.cos(b * x)) + B * (np.sinh(a * x) - a / b * np.sin(b * x))

    def slope(x):
        return A * (a * np.sinh(a * x) + b * np.sin(b * x)) + B * a * (np.cosh(a * x) - np.cos(b * x))

    scale = TIP / shape(1.0)
    return frequency, lambda x: scale * shape(x), lambda x: scale * slope(x)


def _exponents(frequency):
    half = np.sqrt(0.25 * LOAD**2 + frequency**2)
    return np.sqrt(half - 0.5 * LOAD), np.sqrt(half + 0.5 * LOAD)


def _tip(frequency):
    """Moment and shear at the tip of the two shapes, 2 x 2."""
    a, b = _exponents(frequency)
    return np.array([
        [a**2 * np.cosh(a) + b**2 * np.cos(b), a**2 * np.sinh(a) + a * b * np.sin(b)],
        [a**3 * np.sinh(a) - b**3 * np.sin(b), a**3 * np.cosh(a) + a * b**2 * np.cos(b)],
    ])
