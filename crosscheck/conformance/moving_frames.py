"""Frames that move with the speeds of a tree: how a fixed offset carries one, and how a freedom moves it."""

from __future__ import annotations

from typing import NamedTuple, assert_never

import numpy as np

from crosscheck.engines.conventions import axis_rotation, cross_matrix, rotation_matrix
from flexmb.scene.freedoms import Ball, Floating, Freedom, ScalarFreedom
from flexmb.typing import Real


class PlacedFrame(NamedTuple):
    """A frame in World axes: rotation R, origin p; w = Jw u and v = Jv u are its velocities for the speeds u.

    `alpha` and `a` are the accelerations that it has where all rates of u are zero.
    """

    R: Real
    p: Real
    Jw: Real
    Jv: Real
    w: Real
    v: Real
    alpha: Real
    a: Real

    def moved(self, turns: bool, axis: Real, column: int, value: float, rate: float) -> PlacedFrame:
        """The frame turned about `axis`, or shifted along it, by a coordinate; the axis need not have unit length."""
        along = (self.R @ axis)[:, None]
        if turns:
            size = float(np.linalg.norm(axis))
            turned = axis_rotation(axis / size, size * value) if size else np.eye(3)
            return self._freed(np.zeros(3), turned, [column], along, 0.0 * along, np.array([rate]), self.w)
        return self._freed(value * axis, np.eye(3), [column], 0.0 * along, along, np.array([rate]), self.w)

    def _freed(
        self, shift: Real, turned: Real, columns: list[int], turns: Real, shifts: Real, rates: Real, w_of_shifts: Real
    ) -> PlacedFrame:
        """The frame after a freedom with speeds in `columns`, along `turns` and `shifts` (3,k) in World axes.

        Turns are fixed in the frame before or after (both have the same rate), shifts in one that turns with
        `w_of_shifts`.
        """
        at = carried(self, shift, turned)
        Jw, Jv = at.Jw.copy(), at.Jv.copy()
        Jw[:, columns] += turns
        Jv[:, columns] += shifts
        turning, shifting = turns @ rates, shifts @ rates
        alpha = at.alpha + cross(self.w, turning)
        a = at.a + cross(self.w, shifting) + cross(w_of_shifts, shifting)
        return PlacedFrame(at.R, at.p, Jw, Jv, at.w + turning, at.v + shifting, alpha, a)


def cross(a: Real, b: Real) -> Real:
    """a x b of two vectors (3,), in a third of the time that indexing arrays takes."""
    (u, v, w), (x, y, z) = a.tolist(), b.tolist()
    return np.array([v * z - w * y, w * x - u * z, u * y - v * x])


def ground(size: int) -> PlacedFrame:
    """The World frame in a tree with `size` speeds."""
    none, still = np.zeros((3, size)), np.zeros(3)
    return PlacedFrame(np.eye(3), still, none, none, still, still, still, still)


def carried(at: PlacedFrame, offset: Real, turned: Real | None = None) -> PlacedFrame:
    """A frame fixed to another one, at an offset and turned in its axes."""
    r = at.R @ offset
    R = at.R if turned is None else at.R @ turned
    Jv = at.Jv - cross_matrix(r) @ at.Jw
    a = at.a + cross(at.alpha, r) + cross(at.w, cross(at.w, r))
    return PlacedFrame(R, at.p + r, at.Jw, Jv, at.w, at.v + cross(at.w, r), at.alpha, a)


def freed(at: PlacedFrame, freedom: Freedom, column: int, q: Real, u: Real) -> PlacedFrame:
    """The frame after a freedom whose first speed is number `column`.

    Quaternions are those of the freedom, its initial ones: only scalar coordinates are taken from `q`.
    """
    match freedom:
        case ScalarFreedom(motion="turn" | "slide"):
            turning = freedom.motion == "turn"
            return at.moved(turning, np.array(freedom.axis), column, float(q[column]), float(u[column]))
        case ScalarFreedom():
            raise NotImplementedError(f"{freedom.name}: clauses on trees have no screws")
        case Ball():
            turned, columns = rotation_matrix(freedom.quaternion), list(range(column, column + 3))
            axes = at.R @ turned
            return at._freed(np.zeros(3), turned, columns, axes, 0.0 * axes, u[columns], at.w)
        case Floating():
            turned, columns = rotation_matrix(freedom.quaternion), list(range(column, column + 6))
            axes, none = at.R @ turned, np.zeros((3, 3))
            turns, shifts = np.hstack([axes, none]), np.hstack([none, axes])
            w_out = at.w + turns @ u[columns]
            return at._freed(np.array(freedom.position), turned, columns, turns, shifts, u[columns], w_out)
        case _:
            assert_never(freedom)
