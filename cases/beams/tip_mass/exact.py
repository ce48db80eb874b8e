"""Closed form: an Euler-Bernoulli cantilever with a point mass at its tip, straight and at rest, let go under gravity.

The field is w(x, t) = sum_n phi_n(x) g_n (1 - cos omega_n t) / omega_n^2 with the modes of beam and mass,
1 + cos(b) cosh(b) + mu b (cos(b) sinh(b) - sin(b) cosh(b)) = 0 where mu is the mass over that of the beam,
omega_n = b_n^2 sqrt(EI/(m L^4)), and g_n = g (int m phi_n dx + M phi_n(L)) / (int m phi_n^2 dx + M phi_n(L)^2).
"""

import numpy as np
from scipy.optimize import brentq

LENGTH, STIFFNESS, MASS, TIP, GRAVITY = 2.0, 40.0, 0.5, 1.0, -0.05  # m, N m^2, kg/m, kg, m/s^2 along y
RATIO = TIP / (MASS * LENGTH)
MODES = 40


def exact(times):
    """Position and velocity (T, 3) of tip and middle (m, m/s), and the strain energy (T, 1) (J)."""
    beta = _roots()
    omega = beta**2 * np.sqrt(STIFFNESS / (MASS * LENGTH**4))
    nodes, weights = np.polynomial.legendre.leggauss(400)
    x, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    along = np.array([_mode(b, x) for b in beta])
    tip = np.array([_mode(b, 1.0) for b in beta])
    inertia = MASS * LENGTH * (along**2 @ weights) + TIP * tip**2
    amplitude = GRAVITY * (MASS * LENGTH * (along @ weights) + TIP * tip) / inertia / omega**2
    swing, rate = 1.0 - np.cos(np.outer(times, omega)), np.sin(np.outer(times, omega)) * omega
    channels = {}
    for name, place in {"tip": 1.0, "middle": 0.5}.items():
        shape = np.array([_mode(b, place) for b in beta]) * amplitude
        zero = np.zeros(len(times))
        channels[f"marker:{name}.position"] = np.column_stack([zero + place * LENGTH, swing @ shape, zero])
        channels[f"marker:{name}.velocity"] = np.column_stack([zero, rate @ shape, zero])
    channels["energy.strain"] = 0.5 * (swing * amplitude * omega) ** 2 @ inertia[:, None]
    return channels


def _roots():
    """beta_n, where 1/cosh + cos + mu b (cos tanh - sin) = 0: one between every two multiples of pi."""

    def equation(b):
        return 1.0 / np.cosh(b) + np.cos(b) + RATIO * b * (np.cos(b) * np.tanh(b) - np.sin(b))

    starts = np.arange(MODES) * np.pi
    return np.array([brentq(equation, start + 1e-6, start + np.pi, xtol=1e-15) for start in starts])


def _mode(beta, x):
    """cosh - cos - s (sinh - sin) of beta x/L, without moment at the tip: s = (cosh + cos) / (sinh + sin) of beta."""
    whole = np.sinh(beta) + np.sin(beta)
    ratio = (np.cosh(beta) + np.cos(beta)) / whole
    rising = 0.5 * np.exp(beta * x) * (np.sin(beta) - np.cos(beta) - np.exp(-beta)) / whole
    return rising + 0.5 * (1.0 + ratio) * np.exp(-beta * x) - np.cos(beta * x) + ratio * np.sin(beta * x)
