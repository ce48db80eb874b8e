"""Vectors, rotations, quaternions (scalar first) and rotation vectors."""

from math import factorial

import numpy as np


def skew(a):
    """The matrix with skew(a) b = a x b, of vectors (..., 3)."""
    a = np.asarray(a)
    if a.ndim == 1:
        x, y, z = a
        return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    z = np.zeros(a.shape[:-1])
    rows = [[z, -a[..., 2], a[..., 1]], [a[..., 2], z, -a[..., 0]], [-a[..., 1], a[..., 0], z]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def cross(a, b):
    """a x b over the last axis; NumPy's own takes ten times as long for a single vector, indexing three."""
    if a.ndim == 1 and b.ndim == 1:
        (u, v, w), (x, y, z) = a.tolist(), b.tolist()
        return np.array([v * z - w * y, w * x - u * z, u * y - v * x])
    return a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]


_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def turn(axis, angle):
    """Rotation about a unit vector (Rodrigues)."""
    k = skew(np.asarray(axis, float))
    return np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k


def matrix_of(q):
    """Rotation matrix of a quaternion, scalar first, of any length."""
    w, *v = np.asarray(q, float) / np.linalg.norm(q)
    return (w * w - np.dot(v, v)) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * skew(v)


def quaternion_of(R):
    """Quaternion of a rotation matrix, scalar first and not negative."""
    Q = R + R.T + (1.0 - np.trace(R)) * np.eye(3)
    odd = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    four = np.block([[np.array([[1.0 + np.trace(R)]]), odd[None]], [odd[:, None], Q]])
    row = four[np.argmax(np.diag(four))]
    row = row / np.linalg.norm(row)
    return row if row[0] >= 0.0 else -row


def rotation_vector(q):
    """The rotation vector of a quaternion, at most pi long."""
    q = np.asarray(q) / np.linalg.norm(q)
    q = q if q[0] >= 0.0 else -q
    s = np.linalg.norm(q[1:])
    return 2.0 * q[1:] if s == 0.0 else 2.0 * np.arctan2(s, q[0]) / s * q[1:]


def quaternion_rate(q, w):
    """Rate of a quaternion, for the angular velocity in the axes that turn."""
    return 0.5 * np.concatenate([[-np.dot(q[1:], w)], q[0] * w + cross(q[1:], w)])


TERMS = [np.array([(-1.0) ** k / factorial(2 * k + 2 + kind) for k in range(13)]) for kind in (0, 1)]
SLOPES = [np.array([k * c for k, c in enumerate(terms)][1:]) for terms in TERMS]


def series(x, kind):
    """(1 - cos s) / s^2 (kind 0) or (s - sin s) / s^3 (kind 1), x = s^2 up to (2 pi)^2, and the derivative by x."""
    return np.polyval(TERMS[kind][::-1], x), np.polyval(SLOPES[kind][::-1], x)


def turned_by(theta, theta_rate):
    """Of rotation vectors (n,3) and their rates: exp(theta~), the left Jacobian J with w = J theta', and its rate."""
    x, x_rate = np.sum(theta * theta, -1), 2.0 * np.sum(theta * theta_rate, -1)
    (a, da), (b, db) = series(x, 0), series(x, 1)
    K, L = skew(theta), skew(theta_rate)
    KK, KL = K @ K, K @ L + L @ K
    wide = (..., None, None)
    jacobian = np.eye(3) + a[wide] * K + b[wide] * KK
    rate = (da * x_rate)[wide] * K + a[wide] * L + (db * x_rate)[wide] * KK + b[wide] * KL
    rotation = np.eye(3) + (1.0 - x * b)[wide] * K + a[wide] * KK
    return rotation, jacobian, rate
