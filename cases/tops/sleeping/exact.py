"""Lagrange's heavy top, released with its spin alone: height by Jacobi's elliptic functions, the rest by quadrature.

With u the cosine of the lean, u'^2 = beta (u0 - u) (u - u1) (u3 - u).
"""

import numpy as np
from scipy.special import ellipj

MASS, HEIGHT, GRAVITY = 1.0, 0.2, 9.81
ACROSS, ALONG = 0.008 + MASS * HEIGHT**2, 0.006  # moments of inertia about the fixed point
SPIN, LEAN = 140.0, 0.01
MARKERS = {"apex": np.array([0.0, 0.0, 0.3]), "rim": np.array([0.1, 0.0, 0.2])}

U0, A, BETA = np.cos(LEAN), ALONG * SPIN / ACROSS, 2.0 * MASS * GRAVITY * HEIGHT / ACROSS
OVER = A**2 / (2.0 * BETA) - U0
LARGER = abs(OVER) + np.hypot(OVER, np.sin(LEAN))
SMALLER = np.sin(LEAN) ** 2 / LARGER  # without cancellation: the product is known
ABOVE, FALL = (LARGER, SMALLER) if OVER > 0.0 else (SMALLER, LARGER)  # u3 - u0 and u0 - u1
MODULUS, RATE = FALL / (FALL + ABOVE), 0.5 * np.sqrt(BETA * (FALL + ABOVE))


def exact(times):
    """Position and velocities of both markers at `times` (s), World axes, SI."""
    below, change = height(times)
    u, sine = U0 - below, np.sqrt(sine_squared(below))
    precession, spin = primitive(precession_rate, times), SPIN * times - primitive(along_axis, times)
    R = turn(2, precession) @ turn(0, np.arctan2(sine, u)) @ turn(2, spin)
    nodes = np.stack([np.cos(precession), np.sin(precession), 0.0 * times], axis=1)
    omega = precession_rate(times)[:, None] * np.array([0.0, 0.0, 1.0]) + (change / sine)[:, None] * nodes
    omega = omega + (SPIN - along_axis(times))[:, None] * R[:, :, 2]
    channels = {}
    for name, point in MARKERS.items():
        channels[f"marker:{name}.position"] = R @ point
        channels[f"marker:{name}.velocity"] = np.cross(omega, R @ point)
        channels[f"marker:{name}.angular_velocity"] = omega
    return channels


def height(times):
    """u0 - u and its rate."""
    sn, cn, dn, _ = ellipj(RATE * times, MODULUS)
    depth = FALL * (1.0 - MODULUS)
    return depth * (sn / dn) ** 2, 2.0 * depth * RATE * sn * cn / dn**3


def sine_squared(below):
    """1 - u^2."""
    return np.sin(LEAN) ** 2 + below * (2.0 * U0 - below)


def precession_rate(times):
    below, _ = height(times)
    return A * below / sine_squared(below)


def along_axis(times):
    """The part of the precession that is along the top's axis."""
    return precession_rate(times) * (U0 - height(times)[0])


def primitive(rate, times):
    """The integral of `rate` from 0 to each of `times`, by Gauss-Legendre between them."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    pieces = 24
    edges = np.append(np.linspace(times[:-1], times[1:], pieces, endpoint=False).T, times[-1])
    half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    parts = half * (rate(middle[:, None] + half[:, None] * nodes) @ weights)
    return np.concatenate([[0.0], np.cumsum(parts.reshape(-1, pieces).sum(axis=1))])


def turn(axis, angles):
    """Rotations (T, 3, 3) about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((len(angles), 3, 3))
    R[:, axis, axis] = 1.0
    R[:, i, i] = R[:, j, j] = np.cos(angles)
    R[:, j, i] = np.sin(angles)
    R[:, i, j] = -np.sin(angles)
    return R
