"""Rotations of a scene's frames by numpy alone, because importing SciPy takes longer than a first evaluation.

Quaternions are scalar first; R_AB maps components in B to components in A. Angles are those of successive rotations
about carried axes, as in a gimbal.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexmb.typing import Index, Real


def cross_matrix(a: Real) -> Real:
    """Cross-product matrices (..., 3, 3) of vectors (..., 3): cross_matrix(a) b = a x b."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotation_matrix(quaternion: ArrayLike) -> Real:
    """R (...,3,3) of quaternions (...,4), which are normalised; ValueError if one is zero."""
    given = np.asarray(quaternion, dtype=float)
    size = np.linalg.norm(given, axis=-1, keepdims=True)
    if np.any(size == 0.0):
        raise ValueError("a quaternion of length zero is not a rotation")
    unit = given / size
    w, x, y, z = unit[..., 0], unit[..., 1], unit[..., 2], unit[..., 3]
    R = np.empty((*given.shape[:-1], 3, 3))
    R[..., 0, 0], R[..., 0, 1], R[..., 0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
    R[..., 1, 0], R[..., 1, 1], R[..., 1, 2] = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
    R[..., 2, 0], R[..., 2, 1], R[..., 2, 2] = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    return R


_CYCLIC: Index = np.array([(0, 1, 2), (1, 2, 0), (2, 0, 1)])


def quaternion_of(R: Real) -> Real:
    """Unit quaternions (...,4) of rotation matrices (...,3,3), with the sign that makes the first nonzero positive.

    Each is computed from its largest component, so that no digits are lost near half a turn: Markley, J. Guidance 31
    (2008) 440.
    """
    trace = np.trace(R, axis1=-2, axis2=-1)
    i, j, k = _CYCLIC
    candidates = np.empty((*np.shape(R)[:-2], 4, 4))  # row r is 4 q_r times the quaternion
    candidates[..., 0, 0] = 1.0 + trace
    candidates[..., 0, 1:] = candidates[..., 1:, 0] = R[..., k, j] - R[..., j, k]
    candidates[..., 1:, 1:] = R + np.swapaxes(R, -1, -2)
    candidates[..., 1 + i, 1 + i] = 1.0 - trace[..., None] + 2.0 * R[..., i, i]
    all_of_them = candidates.reshape(-1, 4, 4)
    each = np.arange(len(all_of_them))
    quaternion = all_of_them[each, np.argmax(np.diagonal(all_of_them, axis1=-2, axis2=-1), axis=-1)]
    quaternion /= np.linalg.norm(quaternion, axis=-1, keepdims=True)
    quaternion[quaternion[each, np.argmax(quaternion != 0.0, axis=-1)] < 0.0] *= -1.0
    return quaternion.reshape(*np.shape(R)[:-2], 4)


def rotation_by(vector: ArrayLike) -> Real:
    """R (...,3,3) of rotation vectors (...,3) in rad: rotation about each by its length."""
    v = np.asarray(vector, dtype=float)
    half = np.linalg.norm(v, axis=-1, keepdims=True) / 2.0
    return rotation_matrix(np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * v], axis=-1))


def about(axis: str, angle: float) -> Real:
    """R (3,3) of a rotation by `angle` (rad) about "x", "y" or "z"."""
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    R = np.eye(3)
    R[j, j] = R[k, k] = np.cos(angle)
    R[k, j] = np.sin(angle)
    R[j, k] = -R[k, j]
    return R


SEQUENCES = tuple(a + b + c for a in "xyz" for b in "xyz" for c in "xyz" if a != b != c)
# Gimbal lock: sine of the angle between the outer axes below which either outer angle has less than half its digits.
LOCKED = 1e-8


class Angles(NamedTuple):
    """values (...,3) rad of the three rotations; singular (...): whether the outer axes align (gimbal lock).

    In gimbal lock only the sum or the difference of the outer angles is determined, and the third angle is set to zero.
    """

    values: Real
    singular: NDArray[np.bool_]


def angles_of(quaternion: ArrayLike, sequence: str = "zyx") -> Angles:
    """Angles of quaternions (...,4), scalar first, about the axes of a gimbal's `sequence`.

    "zyx": about z, then the carried y, then the carried x (yaw, pitch, roll). The middle angle is within +-pi/2 if all
    three axes differ, and otherwise (as in "zxz") from 0 to pi; the others are within +-pi. ValueError for any other
    sequence, or a quaternion of length zero.
    """
    if sequence not in SEQUENCES:
        raise ValueError(f"{sequence!r} is not a sequence of three axes: use one of {', '.join(SEQUENCES)}")
    i, j, k = ("xyz".index(letter) for letter in sequence)
    R = rotation_matrix(quaternion)
    proper = i == k
    last = 3 - i - j  # the axis that is neither of the first two
    even = 1.0 if (j - i) % 3 == 1 else -1.0
    if proper:
        across = np.hypot(R[..., i, j], R[..., i, last])
        middle = np.arctan2(across, R[..., i, i])
        first = np.arctan2(R[..., j, i], -even * R[..., last, i])
        third = np.arctan2(R[..., i, j], even * R[..., i, last])
    else:
        across = np.hypot(R[..., i, i], R[..., i, j])
        middle = np.arctan2(even * R[..., i, last], across)
        first = np.arctan2(-even * R[..., j, last], R[..., last, last])
        third = np.arctan2(-even * R[..., i, j], R[..., i, i])
    singular = across < LOCKED
    # With the third angle zero, R is the first rotation times the middle one.
    p, q = (i + 1) % 3, (i + 2) % 3
    alone = R @ np.swapaxes(_about_each("xyz"[j], middle), -1, -2)
    first = np.where(singular, np.arctan2(alone[..., q, p], alone[..., p, p]), first)
    values = np.stack([first, middle, np.where(singular, 0.0, third)], axis=-1)
    return Angles(values, singular)


def _about_each(axis: str, angles: Real) -> Real:
    """Rotations (...,3,3) about one axis by angles (...)."""
    flat = np.array([about(axis, angle) for angle in np.ravel(angles)]).reshape(-1, 3, 3)
    return flat.reshape(*np.shape(angles), 3, 3)
