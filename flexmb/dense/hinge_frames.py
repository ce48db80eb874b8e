"""Hinges in the dense route: sizes, frames, rates and springs of the freedoms of which they consist.

The freedoms of a hinge are those in the scene. The compiled kernels of `flexmb.hinges` do not use them, but implement
each kind of hinge separately. An error in either therefore shows when the two routes are compared.
"""

from __future__ import annotations

from typing import assert_never

import numpy as np
from numpy.typing import ArrayLike

from flexmb.dense.jets import Jet, MovingFrame, constant, product, rotation_about, skew
from flexmb.scene import schema as s
from flexmb.scene.freedoms import Ball, Floating, Freedom, ScalarFreedom
from flexmb.typing import Real

Item = s.Hinge | s.PointMass
UNMOVED, UNTURNED = constant(np.zeros((1, 1, 3))), constant(np.eye(3)[None, None])


def hinge_sizes(hinge: Item) -> tuple[int, int]:
    """Numbers of coordinates and speeds."""
    sizes = [freedom.sizes for freedom in hinge.freedoms]
    return sum(q for q, _ in sizes), sum(u for _, u in sizes)


def hinge_frame(hinge: Item, c: Jet) -> MovingFrame:
    """Outboard hinge frame seen from the inboard one; c (B,1,n) are jets of its coordinates, rates its speeds."""
    found, place = rotated(), 0
    for freedom in hinge.freedoms:
        count = max(freedom.sizes)
        own = _across(freedom, c[..., place : place + count])
        found, place = found.carry(own) if place else own, place + count
    return found


def _across(freedom: Freedom, c: Jet) -> MovingFrame:
    """The frame beyond one freedom."""
    match freedom:
        case ScalarFreedom(axis=axis):
            along = moved((axis, c[..., 0].map(lambda x: freedom.shifts * x))) if freedom.shifts else moved()
            turned = rotated((axis, c[..., 0])) if freedom.turns else rotated()
            return MovingFrame(along.position, turned.rotation)
        case Ball():
            return MovingFrame(moved().position, _attitude(c.value, c.rate, c.acceleration))
        case Floating():
            return _floating(c)
        case _:
            assert_never(freedom)


def rotated(*turns: tuple[ArrayLike, Jet]) -> MovingFrame:
    """Successive rotations about carried axes."""
    rotation = UNTURNED
    for axis, angle in turns:
        about = rotation_about(axis, angle)
        rotation = about if rotation is UNTURNED else rotation @ about
    return MovingFrame(UNMOVED, rotation)


def moved(*steps: tuple[ArrayLike, Jet]) -> MovingFrame:
    """A sum of translations along fixed axes."""
    position = UNMOVED
    for axis, distance in steps:
        position = position + product(np.multiply, constant(axis), distance[..., None])
    return MovingFrame(position, UNTURNED)


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
    found, i, j = [u[:0]], 0, 0
    for freedom in hinge.freedoms:
        nq, nu = freedom.sizes
        found.append(_rates(freedom, q[i : i + nq], u[j : j + nu]))
        i, j = i + nq, j + nu
    return np.concatenate(found)


def _rates(freedom: Freedom, q: Real, u: Real) -> Real:
    match freedom:
        case ScalarFreedom():
            return u
        case Ball():
            return _quaternion_rate(q, u)
        case Floating():
            still = np.zeros((1, 1, 6))
            R = _floating(Jet(q[None, None], still, still)).rotation.value[0, 0]
            return np.concatenate([R @ u[3:], _quaternion_rate(q[3:], u[:3])])
        case _:
            assert_never(freedom)


def ball_torque(hinge: Item, q: Real, u: Real) -> Real | float:
    """Generalised force (3,) of the isotropic spring and damper of a spherical hinge, 0 for all other kinds."""
    for ball in _balls(hinge):
        return -ball.stiffness * _rotation_vector(q) - ball.damping * u
    return 0.0


def ball_energy(hinge: Item, q: Real) -> float:
    """Energy (J) of that spring."""
    return sum(0.5 * ball.stiffness * float(np.sum(_rotation_vector(q) ** 2)) for ball in _balls(hinge))


def _balls(hinge: Item) -> list[Ball]:
    """The ball joint that a hinge is, if any."""
    return [freedom for freedom in hinge.freedoms if isinstance(freedom, Ball)]


def _rotation_vector(quaternion: Real) -> Real:
    """Rotation vector (3,) of a scalar-first quaternion, of length at most pi."""
    from scipy.spatial.transform import Rotation  # slow to import, and only springs of balls need it

    return Rotation.from_quat(quaternion, scalar_first=True).as_rotvec()


def _quaternion_rate(x: Real, w: Real) -> Real:
    """1/2 x (0, w): scalar first, w in turning axes."""
    return 0.5 * np.concatenate([[-x[1:] @ w], x[0] * w + np.cross(x[1:], w)])
