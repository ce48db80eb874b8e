"""Closed forms that several cases with tops share; the `exact.py` of a case calls them with its numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import ellipj

from flexmb.typing import Real

MASS, HEIGHT, GRAVITY = 1.0, 0.2, 9.81  # of the top in these cases (kg, m, m/s^2)
ACROSS, ALONG = 0.008 + MASS * HEIGHT**2, 0.006  # moments of inertia about the fixed point (kg m^2)
MARKERS = {"apex": np.array([0.0, 0.0, 0.3]), "rim": np.array([0.1, 0.0, 0.2])}


class HeavyTop:
    """Lagrange's heavy top, released with its spin alone.

    Its height follows from Jacobi's elliptic functions, all other angles by quadrature.
    With u the cosine of the lean, u'^2 = beta (u0 - u) (u - u1) (u3 - u). `spin` is in rad/s, `lean` in rad.
    """

    def __init__(self, spin: float, lean: float) -> None:
        self.spin, self.lean = spin, lean
        self._u0, self._a = np.cos(lean), ALONG * spin / ACROSS
        beta = 2.0 * MASS * GRAVITY * HEIGHT / ACROSS
        over = self._a**2 / (2.0 * beta) - self._u0
        larger = abs(over) + np.hypot(over, np.sin(lean))
        smaller = np.sin(lean) ** 2 / larger  # the product of both is known: no cancellation
        above, self._fall = (larger, smaller) if over > 0.0 else (smaller, larger)  # u3 - u0 and u0 - u1
        self._modulus, self._rate = self._fall / (self._fall + above), 0.5 * np.sqrt(beta * (self._fall + above))

    def exact(self, times: Real) -> dict[str, Real]:
        """Position and velocities of both markers at `times` (s), World axes, SI."""
        below, change = self._height(times)
        u, sine = self._u0 - below, np.sqrt(self._sine_squared(below))
        precession = primitive(self._precession_rate, times, 24)
        spin = self.spin * times - primitive(self._along_axis, times, 24)
        R = turn(2, precession) @ turn(0, np.arctan2(sine, u)) @ turn(2, spin)
        nodes = np.stack([np.cos(precession), np.sin(precession), 0.0 * times], axis=1)
        omega = self._precession_rate(times)[:, None] * np.array([0.0, 0.0, 1.0]) + (change / sine)[:, None] * nodes
        omega = omega + (self.spin - self._along_axis(times))[:, None] * R[:, :, 2]
        channels = {}
        for name, point in MARKERS.items():
            channels[f"marker:{name}.position"] = R @ point
            channels[f"marker:{name}.velocity"] = np.cross(omega, R @ point)
            channels[f"marker:{name}.angular_velocity"] = omega
        return channels

    def _height(self, times: Real) -> tuple[Real, Real]:
        """u0 - u and its rate."""
        sn, cn, dn, _ = ellipj(self._rate * times, self._modulus)
        depth = self._fall * (1.0 - self._modulus)
        return depth * (sn / dn) ** 2, 2.0 * depth * self._rate * sn * cn / dn**3

    def _sine_squared(self, below: Real) -> Real:
        """1 - u^2."""
        return np.sin(self.lean) ** 2 + below * (2.0 * self._u0 - below)

    def _precession_rate(self, times: Real) -> Real:
        below, _ = self._height(times)
        return self._a * below / self._sine_squared(below)

    def _along_axis(self, times: Real) -> Real:
        """The part of the precession that is along the top's axis."""
        return self._precession_rate(times) * (self._u0 - self._height(times)[0])


def primitive(rate: Callable[[Real], Real], times: Real, pieces: int) -> Real:
    """The integral of `rate` from 0 to each of `times`, by Gauss-Legendre in so many pieces between neighbours."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    edges = np.append(np.linspace(times[:-1], times[1:], pieces, endpoint=False).T, times[-1])
    half, middle = 0.5 * np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    parts = half * (rate(middle[:, None] + half[:, None] * nodes) @ weights)
    return np.concatenate([[0.0], np.cumsum(parts.reshape(-1, pieces).sum(axis=1))])


def turn(axis: int, angles: Real) -> Real:
    """Rotations (T, 3, 3) about a coordinate axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.zeros((len(angles), 3, 3))
    R[:, axis, axis] = 1.0
    R[:, i, i] = R[:, j, j] = np.cos(angles)
    R[:, j, i] = np.sin(angles)
    R[:, i, j] = -np.sin(angles)
    return R
