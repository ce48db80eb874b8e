"""Conversions of quaternions, spatial vectors, frames, wrenches and free-joint velocities; there are no others.

The project's side of every conversion: quaternions scalar-first, spatial vectors angular first, `R_AB` maps B
components to A components, a wrench [tau; f] acts on the body for which it is named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexmb.scene.schema import Body, Hinge
from flexmb.scene.tree import GROUND, node_frame
from flexmb.typing import Real

_LAST, _FIRST = np.array([1, 2, 3, 0]), np.array([3, 0, 1, 2])  # arrays: converting a list takes longer than indexing


def scalar_last(quaternion: ArrayLike) -> Real:
    """wxyz (..., 4) to xyzw (Pinocchio, SciPy)."""
    return np.asarray(quaternion, dtype=float).take(_LAST, axis=-1)


def scalar_first(quaternion: ArrayLike) -> Real:
    """xyzw (..., 4) to wxyz (this project, MuJoCo, Exudyn)."""
    return np.asarray(quaternion, dtype=float).take(_FIRST, axis=-1)


def angular_first(spatial: ArrayLike) -> Real:
    """[linear; angular] (..., 6) to [angular; linear]; its own inverse."""
    return np.asarray(spatial, dtype=float)[..., [3, 4, 5, 0, 1, 2]]


def cross(a: Real, b: Real) -> Real:
    """a x b over the last axis (..., 3); the general `np.cross` takes twenty times as long, and two single vectors are
    fastest in plain numbers."""
    if a.ndim == b.ndim == 1:
        (p, q, r), (x, y, z) = a.tolist(), b.tolist()
        return np.array([q * z - r * y, r * x - p * z, p * y - q * x])
    return a[..., [1, 2, 0]] * b[..., [2, 0, 1]] - a[..., [2, 0, 1]] * b[..., [1, 2, 0]]


def cross_matrix(a: ArrayLike) -> Real:
    """skew(a) (3,3): skew(a) b = a x b."""
    x, y, z = np.asarray(a, dtype=float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_matrix(quaternion: ArrayLike) -> Real:
    """R (3,3) of a unit quaternion wxyz."""
    w, *vector = np.asarray(quaternion, dtype=float)
    v = np.array(vector)
    return (w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * cross_matrix(v)


def rotated(quaternion: ArrayLike, vector: ArrayLike) -> Real:
    """A vector (3,) turned by a unit quaternion wxyz; in plain numbers it takes a third of the time of its matrix."""
    w, x, y, z = np.asarray(quaternion).tolist()
    a, b, c = np.asarray(vector).tolist()
    d, e, f = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return np.array([a + w * d + y * f - z * e, b + w * e + z * d - x * f, c + w * f + x * e - y * d])


def quaternion_of(rotation: ArrayLike) -> Real:
    """Unit quaternion wxyz with w >= 0 of a rotation matrix (3,3), by its largest component (no cancellation)."""
    R = np.asarray(rotation, dtype=float)
    # 4 q q' in terms of R; the row with the largest diagonal is the best conditioned.
    Q = np.empty((4, 4))
    Q[0, 0] = 1.0 + np.trace(R)
    Q[0, 1:] = Q[1:, 0] = (R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1])
    Q[1:, 1:] = R + R.T + (1.0 - np.trace(R)) * np.eye(3)
    row = Q[np.argmax(np.diag(Q))]
    q = row / np.linalg.norm(row)
    return q if q[0] >= 0.0 else -q


def rotation_vector(quaternion: ArrayLike) -> Real:
    """Rotation vector (3,) of a unit quaternion wxyz, angle in [0, pi]."""
    q = np.asarray(quaternion, dtype=float)
    q = q if q[0] >= 0.0 else -q
    s = np.linalg.norm(q[1:])
    return 2.0 * q[1:] if s == 0.0 else 2.0 * np.arctan2(s, q[0]) / s * q[1:]


def axis_rotation(axis: ArrayLike, angle: float) -> Real:
    """R (3,3) of a turn by `angle` about the unit vector `axis` (Rodrigues)."""
    K = cross_matrix(axis)
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def axes_with(axis: Real, column: int) -> Real:
    """A rotation (3,3) with `axis` as its column number `column`."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    second = np.cross(axis, helper)
    second /= np.linalg.norm(second)
    columns = [axis, second, np.cross(axis, second)]
    return np.stack(np.roll(np.array(columns), column, axis=0), axis=1)


def quaternion_rate(quaternion: ArrayLike, omega: ArrayLike) -> Real:
    """d/dt of wxyz for the angular velocity `omega` in the turning (outboard) axes: 1/2 q o (0, omega)."""
    w, x, y, z = quaternion
    a, b, c = omega
    return 0.5 * np.array([-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a])


def shift_wrench(wrench: Real, offset: Real) -> Real:
    """[tau; f] (..., 6) about Q from the same wrench about O, with `offset` (..., 3) from Q to O, one set of axes."""
    moved = np.array(wrench, dtype=float)
    moved[..., :3] += cross(offset, moved[..., 3:])
    return moved


def rotate_spatial(rotation: Real, spatial: ArrayLike) -> Real:
    """Both halves of a spatial vector (6,) from B to A components with R_AB."""
    return (np.asarray(spatial, dtype=float).reshape(2, 3) @ rotation.T).reshape(6)


@dataclass(frozen=True)
class Frame:
    """Pose of a frame B in A: `position` (3,) m of B's origin in A axes, `rotation` (3,3) = R_AB."""

    position: Real
    rotation: Real

    def __matmul__(self, inner: Frame) -> Frame:
        """X_AB @ X_BC = X_AC."""
        return Frame(self.position + self.rotation @ inner.position, self.rotation @ inner.rotation)

    def inverse(self) -> Frame:
        return Frame(-self.rotation.T @ self.position, self.rotation.T)

    @property
    def quaternion(self) -> Real:
        """wxyz."""
        return quaternion_of(self.rotation)


IDENTITY_FRAME = Frame(np.zeros(3), np.eye(3))


def frame(position: ArrayLike, quaternion: ArrayLike) -> Frame:
    """Frame of the schema's position and scalar-first quaternion."""
    return Frame(np.asarray(position, dtype=float), rotation_matrix(quaternion))


def offset_frame(body: Body, node: str, offset: ArrayLike) -> Frame:
    """Rest frame, in body axes, at a node plus an offset in node axes: markers, wheels, point masses."""
    return frame(*node_frame(body, node)) @ Frame(np.asarray(offset, dtype=float), np.eye(3))


def inboard_frame(hinge: Hinge, parent: Body | None) -> Frame:
    """Inboard hinge frame at rest in the parent body's frame (in World where the parent is the ground: None)."""
    own = frame(hinge.parent_position_m, hinge.parent_quaternion)
    if parent is None:
        if hinge.parent != GROUND:
            raise ValueError(f'hinge "{hinge.name}" needs its parent body "{hinge.parent}"')
        return own
    return frame(*node_frame(parent, hinge.parent_node)) @ own


def outboard_frame(hinge: Hinge, child: Body) -> Frame:
    """Outboard hinge frame at rest in the child body's frame."""
    return frame(*node_frame(child, hinge.child_node)) @ frame(hinge.child_position_m, hinge.child_quaternion)
