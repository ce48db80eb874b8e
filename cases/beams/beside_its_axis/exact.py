"""Closed form: an Euler-Bernoulli cantilever let go under gravity, seen from a line beside its centroid.

The centroid deflects by w(x, t) = sum_n phi_n(x) g_n (1 - cos omega_n t) / omega_n^2 with the clamped-free modes phi_n,
1 + cos(beta) cosh(beta) = 0, omega_n = beta_n^2 sqrt(EI/(m L^4)), and g_n = g int phi_n dx / int phi_n^2 dx. A point of
the line, a distance d below the centroid, has the same deflection and is moved by d w' along the beam.
"""

import numpy as np
from scipy.optimize import brentq

LENGTH, STIFFNESS, MASS, GRAVITY = 2.0, 40.0, 0.5, -0.05  # m, N m^2, kg/m, m/s^2 along y
BESIDE = 0.05  # m, from the line to the centroid
MODES = 40  # the rest is below 1e-9 of the sag


def exact(times):
    """Position and velocity (T, 3) of tip and middle of the line (m, m/s), and the strain energy (T, 1) (J)."""
    channels = {}
    omega, amplitude = _motion()
    swing, swinging = 1.0 - np.cos(np.outer(times, omega)), np.sin(np.outer(times, omega))
    for name, x in {"tip": 1.0, "middle": 0.5}.items():
        shape = np.array([_mode(beta, x) for beta in _roots()]) * amplitude
        along = np.array([_slope(beta, x) for beta in _roots()]) * amplitude / LENGTH * BESIDE
        zero = np.zeros(len(times))
        channels[f"marker:{name}.position"] = np.column_stack([x * LENGTH + swing @ along, swing @ shape, zero])
        rates = swinging @ (along * omega), swinging @ (shape * omega)
        channels[f"marker:{name}.velocity"] = np.column_stack([*rates, zero])
    modal_mass = MASS * LENGTH  # int m phi^2 dx with phi(L) = 2
    stretch = (swing * amplitude * omega) ** 2
    channels["energy.strain"] = 0.5 * modal_mass * stretch.sum(axis=1, keepdims=True)
    return channels


def _roots():
    """beta_n, where cos(beta) + 1/cosh(beta) = 0: one near every (n - 1/2) pi."""
    centres = (np.arange(1, MODES + 1) - 0.5) * np.pi
    return np.array([brentq(lambda b: np.cos(b) + 1.0 / np.cosh(b), c - 1.0, c + 1.0, xtol=1e-15) for c in centres])


def _mode(beta, x):
    """phi_n at x/L = `x`, with int_0^1 phi^2 = 1; nothing in it cancels where beta is large."""
    sigma = _sigma(beta)
    falling = 0.5 * (1.0 + sigma) * np.exp(-beta * x)
    return _rising(beta, x) + falling - np.cos(beta * x) + sigma * np.sin(beta * x)


def _slope(beta, x):
    """The derivative of phi_n by x/L."""
    sigma = _sigma(beta)
    falling = 0.5 * (1.0 + sigma) * np.exp(-beta * x)
    return beta * (_rising(beta, x) - falling + np.sin(beta * x) + sigma * np.cos(beta * x))


def _rising(beta, x):
    return 0.5 * np.exp(beta * x) * (np.exp(-beta) + np.cos(beta) + np.sin(beta)) / (np.cosh(beta) + np.cos(beta))


def _sigma(beta):
    return (np.sinh(beta) - np.sin(beta)) / (np.cosh(beta) + np.cos(beta))


def _motion():
    """Frequencies omega_n (rad/s) and amplitudes g_n / omega_n^2 (m) of the modes."""
    beta = _roots()
    omega = beta**2 * np.sqrt(STIFFNESS / (MASS * LENGTH**4))
    mean = 2.0 * np.array([_sigma(b) for b in beta]) / beta  # int_0^1 phi dx
    return omega, GRAVITY * mean / omega**2
