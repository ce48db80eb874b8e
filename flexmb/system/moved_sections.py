"""Motion of the sections of beams of level exact, for arrays in NumPy; `flexmb.modal.strain_field` has the equations.

Points turn with the deformation by rotation vectors: with theta(t) the rotation exp(theta~) turns at w = J_l thetad.
All are analytic functions of the modal coordinates and their rates, which may be complex.
"""

from __future__ import annotations

from math import factorial
from typing import NamedTuple

import numpy as np

from flexmb.modal.strain_field import LINEAR, SQUARE, STRETCH, WHOLE, StrainField
from flexmb.scene.quaternions import cross_matrix
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


_Rates = tuple[Real, Real, Real]
"""Vectors (n,3) with their first two rates."""


class MovedSections(NamedTuple):
    """Position r, velocity v, acceleration a (n,3), rotation R (n,3,3) from the sections at rest, angular velocity
    omega and acceleration alpha (n,3) of n sections, relative to the body, in its axes."""

    r: Real
    v: Real
    a: Real
    R: Real
    omega: Real
    alpha: Real


def moved_sections(field: StrainField, eta: Real, etad: Real, etadd: Real) -> MovedSections:
    """The sections at modal coordinates (m,) with their first two rates."""

    def sums(row: int) -> _Rates:
        return field.rows[:, row] @ eta, field.rows[:, row] @ etad, field.rows[:, row] @ etadd

    whole, linear, square, (g, g_rate, g_again) = (sums(row) for row in (WHOLE, LINEAR, SQUARE, STRETCH))
    step, spin, spin_rate = turning(*_magnus(whole, linear, square))
    R, omega, alpha = np.empty_like(step), np.empty_like(spin), np.empty_like(spin)
    for j, i in enumerate(field.before):
        if i < 0:
            R[j], omega[j], alpha[j] = step[j], spin[j], spin_rate[j]
            continue
        more = R[i] @ spin[j]
        R[j], omega[j] = R[i] @ step[j], omega[i] + more
        alpha[j] = alpha[i] + cross(omega[i], more) + R[i] @ spin_rate[j]
    at, at_rest = field.gauss, field.tangent[field.gauss]
    w = omega[at]
    tangent, stretching, again = (
        np.einsum("nab,nb->na", R[at], vector) for vector in (at_rest + g[at], g_rate[at], g_again[at])
    )
    turned = cross(w, tangent)
    bent = cross(alpha[at], tangent) + cross(w, turned + 2.0 * stretching) + again
    return MovedSections(
        r=field.position + field.weight @ (tangent - at_rest),
        v=field.weight @ (turned + stretching),
        a=field.weight @ bent,
        R=R,
        omega=omega,
        alpha=alpha,
    )


def cross(a: Real, b: Real) -> Real:
    """a x b of rows (...,3): a third of the time that NumPy's takes for few of them."""
    x, y = a[..., [1, 2, 0]], b[..., [2, 0, 1]]
    return np.asarray(x * y - a[..., [2, 0, 1]] * b[..., [1, 2, 0]])


def _magnus(whole: _Rates, linear: _Rates, square: _Rates) -> _Rates:
    """Omega of `flexmb.spatial.magnus` (n,3) and its first two rates, from those of its arguments."""
    a = _sum(whole, square, -1.0 / 12.0)
    C = _cross(a, linear)
    D = _cross(a, _sum(C, square, -2.0))
    E = _sum(_sum(square, a, 20.0), C, 1.0)
    return _sum(whole, _cross(E, _sum(linear, D, -1.0 / 60.0)), 1.0 / 240.0)


def _sum(x: _Rates, y: _Rates, factor: float) -> _Rates:
    """x + factor y."""
    return x[0] + factor * y[0], x[1] + factor * y[1], x[2] + factor * y[2]


def _cross(x: _Rates, y: _Rates) -> _Rates:
    """x x y by Leibniz' rule."""
    return (
        cross(x[0], y[0]),
        cross(x[1], y[0]) + cross(x[0], y[1]),
        cross(x[2], y[0]) + 2.0 * cross(x[1], y[1]) + cross(x[0], y[2]),
    )
