"""Rotations over many samples at once: Euler parameters, rotation vectors and the left Jacobian of SO(3)."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from crosscheck.engines.conventions import scalar_first, scalar_last
from flexmb.typing import Real

_SERIES_BELOW = 1e-2
"""Angle² (rad²) below which four series terms of the Jacobian's coefficients are exact to round-off."""


def local_rate_map(p: Real) -> Real:
    """G (..., 3, 4) of Euler parameters p (..., 4): angular velocity in body axes = G dp/dt, and dp/dt = G' w / 4."""
    p0, p1, p2, p3 = np.moveaxis(p, -1, 0)
    rows = [(-p1, p0, p3, -p2), (-p2, -p3, p0, p1), (-p3, p2, -p1, p0)]
    return 2.0 * np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def turn_and_rate_map(p: Real) -> tuple[Real, Real]:
    """Rotation matrix and `local_rate_map` of one set of Euler parameters (4,), quickly: for Exudyn's call-backs."""
    p0, p1, p2, p3 = (float(parameter) for parameter in p)
    G = np.array([[-p1, p0, p3, -p2], [-p2, -p3, p0, p1], [-p3, p2, -p1, p0]])
    E = np.array([[-p1, p0, -p3, p2], [-p2, p3, p0, -p1], [-p3, -p2, p1, p0]])
    return E @ G.T, 2.0 * G


def matrices(p: Real) -> Real:
    """Rotation matrices (..., 3, 3), body to World, of Euler parameters (..., 4) (normalised here)."""
    p = np.asarray(p)
    return Rotation.from_quat(scalar_last(p.reshape(-1, 4))).as_matrix().reshape(*p.shape[:-1], 3, 3)


def quaternions(R: Real) -> Real:
    """Quaternions wxyz (..., 4) of rotation matrices (..., 3, 3), with no sign jump from one sample to the next."""
    quaternion = scalar_first(Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat())
    sign = np.where(np.einsum("ti,ti->t", quaternion[1:], quaternion[:-1]) < 0.0, -1.0, 1.0)
    quaternion[1:] *= np.cumprod(sign)[:, None]
    return quaternion.reshape(*R.shape[:-2], 4)


def exponential(theta: Real) -> Real:
    """exp(skew(theta)) (..., 3, 3) of rotation vectors (..., 3)."""
    return Rotation.from_rotvec(theta.reshape(-1, 3)).as_matrix().reshape(*theta.shape[:-1], 3, 3)


def left_jacobian(theta: Real) -> Real:
    """J (..., 3, 3): angular velocity = J dtheta/dt, in the axes theta is given in. Analytic in theta."""
    square = np.sum(theta * theta, axis=-1)
    small = np.abs(square) < _SERIES_BELOW
    s = np.where(small, 1.0, square)
    angle = np.sqrt(s)
    a = np.where(small, 1 / 2 - square / 24 * (1 - square / 30 * (1 - square / 56)), (1 - np.cos(angle)) / s)
    b = np.where(small, 1 / 6 - square / 120 * (1 - square / 42 * (1 - square / 72)), (1 - np.sin(angle) / angle) / s)
    K = cross_matrices(theta)
    return np.eye(3) + a[..., None, None] * K + b[..., None, None] * (K @ K)


def left_jacobian_rate(theta: Real, rate: Real) -> Real:
    """dJ/dt (..., 3, 3) for theta moving at `rate`, by a complex step (exact to round-off)."""
    step = 1e-30
    return left_jacobian(theta + 1j * step * rate).imag / step


def logarithm(turn: Real, apart: Real) -> Real:
    """[translation; rotation] (T,6) whose exponential is a motion: a turn (T,3,3) and a displacement (T,3) in the axes
    from which both start."""
    vector = Rotation.from_matrix(turn).as_rotvec()
    angle = np.linalg.norm(vector, axis=1)
    small = angle**2 < _SERIES_BELOW
    half = np.where(small, 1.0, angle) / 2.0
    # of the square of the cross matrix in the inverse of the left Jacobian
    series = 1.0 / 12.0 * (1.0 + angle**2 / 60.0 * (1.0 + angle**2 / 42.0 * (1.0 + angle**2 / 40.0)))
    factor = np.where(small, series, (1.0 - half / np.tan(half)) / (4.0 * half**2))
    K = cross_matrices(vector)
    inverse = np.eye(3) - 0.5 * K + factor[:, None, None] * (K @ K)
    return np.concatenate([np.einsum("tij,tj->ti", inverse, apart), vector], axis=1)


def cross_matrices(a: Real) -> Real:
    """skew(a) (..., 3, 3) of vectors (..., 3): skew(a) b = a x b."""
    x, y, z = np.moveaxis(a, -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack(r, axis=-1) for r in ((o, -z, y), (z, o, -x), (-y, x, o))], axis=-2)
