"""All that the dense route knows of hinges: sizes, frames, rates and springs of every kind in the schema."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from flexmb.dense.jets import Jet, MovingFrame, constant, product, rotation_about, skew
from flexmb.scene import schema as s
from flexmb.scene.tree import coordinates
from flexmb.typing import Real

Item = s.Hinge | s.PointMass
AXES = dict(zip("xyz", np.eye(3), strict=True))


def hinge_sizes(hinge: Item) -> tuple[int, int]:
    """Numbers of coordinates and speeds."""
    match hinge:
        case s.Spherical():
            return 4, 3
        case s.Free():
            return 7, 6
    count = len(coordinates(hinge))
    return count, count


def hinge_frame(hinge: Item, c: Jet) -> MovingFrame:
    """Outboard hinge frame seen from the inboard one; c (B,1,n) are jets of its coordinates, rates its speeds."""
    match hinge:
        case s.Revolute(axis=axis):
            return rotated((axis, c[..., 0]))
        case s.Prismatic(axis=axis):
            return moved((axis, c[..., 0]))
        case s.Cylindrical(axis=axis):
            return moved((axis, c[..., 1])).carry(rotated((axis, c[..., 0])))
        case s.Universal():
            return rotated((AXES["x"], c[..., 0]), (AXES["y"], c[..., 1]))
        case s.Gimbal(sequence=sequence):
            return rotated(*((AXES[axis], c[..., n]) for n, axis in enumerate(sequence)))
        case s.Planar():
            return moved((AXES["x"], c[..., 0]), (AXES["y"], c[..., 1])).carry(rotated((AXES["z"], c[..., 2])))
        case s.PointMass(directions=directions):
            return moved(*((direction, c[..., n]) for n, direction in enumerate(directions)))
        case s.Spherical():
            return MovingFrame(moved().position, _attitude(c.value, c.rate, c.acceleration))
        case s.Free():
            return _floating(c)
    return rotated()


def rotated(*turns: tuple[ArrayLike, Jet]) -> MovingFrame:
    """Successive rotations about carried axes."""
    rotation = constant(np.eye(3)[None, None])
    for axis, angle in turns:
        rotation = rotation @ rotation_about(axis, angle)
    return MovingFrame(constant(np.zeros((1, 1, 3))), rotation)


def moved(*steps: tuple[ArrayLike, Jet]) -> MovingFrame:
    """A sum of translations along fixed axes."""
    position = constant(np.zeros((1, 1, 3)))
    for axis, distance in steps:
        position = position + product(np.multiply, constant(axis), distance[..., None])
    return MovingFrame(position, constant(np.eye(3)[None, None]))


def _floating(c: Jet) -> MovingFrame:
    """q = [p; quaternion], u = [w; v] in turning axes: p' = R v, p'' = R (w x v + dv/dt)."""
    w, v = c.rate[..., :3], c.rate[..., 3:]
    rotation = _attitude(c.value[..., 3:], w, c.acceleration[..., :3])
    back = np.swapaxes(rotation.value, -1, -2)
    position = Jet(c.value[..., :3], v @ back[0], (np.cross(w, v) + c.acceleration[..., 3:]) @ back[0])
    return MovingFrame(position, rotation)


def _attitude(quaternion: Real, w: Real, w_rate: Real) -> Jet:
    """R of a scalar-first quaternion with angular velocity w in turning axes: R' = R w~, R'' = R (w~ w~ + dw/dt~)."""
    R = rotation_of(quaternion[0, 0])[None, None]
    return Jet(R, R @ skew(w), R @ (skew(w) @ skew(w) + skew(w_rate)))


def rotation_of(quaternion: ArrayLike) -> Real:
    """R (3,3) of a scalar-first quaternion (4,) of any length but zero."""
    x = np.asarray(quaternion)
    q0, qv = x[0], x[1:]
    R = (q0 * q0 - qv @ qv) * np.eye(3) + 2.0 * np.outer(qv, qv) + 2.0 * q0 * skew(qv)
    return np.asarray(R / np.sum(x**2))


def coordinate_rates(hinge: Item, q: Real, u: Real) -> Real:
    """dq/dt of the hinge's coordinates, from its own q and u."""
    match hinge:
        case s.Spherical():
            return _quaternion_rate(q, u)
        case s.Free():
            still = np.zeros((1, 1, 6))
            R = _floating(Jet(q[None, None], still, still)).rotation.value[0, 0]
            return np.concatenate([R @ u[3:], _quaternion_rate(q[3:], u[:3])])
    return u


def ball_torque(hinge: Item, q: Real, u: Real) -> Real | float:
    """Generalised force (3,) of the isotropic spring and damper of a spherical hinge, 0 for all other kinds."""
    if not isinstance(hinge, s.Spherical):
        return 0.0
    return -hinge.stiffness_Nm_rad * _rotation_vector(q) - hinge.damping_Nms_rad * u


def ball_energy(hinge: Item, q: Real) -> float:
    """Energy (J) of that spring."""
    if not isinstance(hinge, s.Spherical):
        return 0.0
    theta = _rotation_vector(q)
    return 0.5 * hinge.stiffness_Nm_rad * float(theta @ theta)


def _rotation_vector(quaternion: Real) -> Real:
    """Rotation vector (3,) of a scalar-first quaternion, of length at most pi."""
    from scipy.spatial.transform import Rotation  # slow to import, and only springs of balls need it

    return Rotation.from_quat(quaternion, scalar_first=True).as_rotvec()


def _quaternion_rate(x: Real, w: Real) -> Real:
    """1/2 x (0, w): scalar first, w in turning axes."""
    return 0.5 * np.concatenate([[-x[1:] @ w], x[0] * w + np.cross(x[1:], w)])
