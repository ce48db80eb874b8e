"""Orientations as angles of successive rotations about carried axes, as in a gimbal."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexmb.scene.quaternions import about, rotation_matrix
from flexmb.typing import Real

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
