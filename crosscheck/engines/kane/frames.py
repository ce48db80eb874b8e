"""Frames on bodies of level "full": where they are, how they move, and their partial velocities.

A node of a body is at r + phi eta and turned by exp(theta~), theta = psi eta, in body axes. A frame keeps its arm and
its axes in those of the node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from crosscheck.engines.kane.moments import LEVI_CIVITA
from flexmb.typing import Real

_TURN = -LEVI_CIVITA.transpose(2, 0, 1).reshape(3, 9)
_FEW = 12  # terms of the series below, for angles of up to 1 rad, where they have all digits


def skew(a: Real) -> Real:
    """Cross matrices (..., 3, 3) of vectors (..., 3)."""
    return (a @ _TURN).reshape(*a.shape[:-1], 3, 3)


def applied(matrices: Real, vectors: Real) -> Real:
    """Matrices (..., a, b) times vectors (..., b)."""
    return (matrices @ vectors[..., None])[..., 0]


def _series() -> Real:
    """(terms, 5): coefficients in s = |theta|^2 of a = sin/|theta|, b, c as in `_exponential`, and of db/ds, dc/ds."""
    k = np.arange(_FEW + 1)
    odd = np.cumprod(np.concatenate([[1.0], 1.0 / np.arange(1.0, 2 * _FEW + 4)]))  # 1 / n!
    sign = np.where(k % 2, -1.0, 1.0)
    a, b, c = (sign * odd[2 * k + n] for n in (1, 2, 3))
    return np.column_stack([a[:-1], b[:-1], c[:-1], k[1:] * b[1:], k[1:] * c[1:]])


_COEFFICIENTS = _series()
_POWERS = np.arange(_FEW)


def _functions(s: Real) -> Real:
    """a, b, c, db/ds, dc/ds (n, 5) for s (n,)."""
    small = (s[:, None] ** _POWERS) @ _COEFFICIENTS
    if s.size == 0 or s.max() <= 1.0:
        return np.asarray(small)
    safe = np.maximum(s, 1.0)
    t = np.sqrt(safe)
    a, b = np.sin(t) / t, (1.0 - np.cos(t)) / safe
    c = (1.0 - a) / safe
    da = (np.cos(t) - a) / (2.0 * safe)
    large = np.column_stack([a, b, c, (0.5 * a - b) / safe, (-da - c) / safe])
    return np.where(s[:, None] <= 1.0, small, large)


class ShapedNode(NamedTuple):
    """Rest position (3,) m and axes (3, 3), node to body, translation and rotation shapes (3, m)."""

    position: Real
    axes: Real
    translation: Real
    rotation: Real


@dataclass(frozen=True)
class FramePlace:
    """A frame at an offset from a node of a body: `arm` (3,) m and `axes` (3, 3) in node axes."""

    body: int
    node: ShapedNode
    arm: Real
    axes: Real


class FreeBodies(NamedTuple):
    """Of b bodies: origins (b, 3), R (b, 3, 3) body to World, velocities of origins (b, 3) in World axes, angular
    velocities (b, 3) in body axes, modal coordinates and rates (b, m)."""

    position: Real
    rotation: Real
    velocity: Real
    angular: Real
    eta: Real
    rate: Real


class MovedFrames(NamedTuple):
    """Of f frames in World axes: positions (f, 3), axes (f, 3, 3), velocities (f, 6) [angular; linear], partial
    velocities (f, 6, 6+m) by a body's coordinates, and the accelerations (f, 6) that these leave."""

    position: Real
    axes: Real
    velocity: Real
    partial: Real
    remaining: Real


class BodyFrames:
    """Frames on bodies, all at once; each with as many modes as the body that has most."""

    def __init__(self, places: Sequence[FramePlace], modes: int) -> None:
        nodes, none = [place.node for place in places], [np.zeros((0, 3))]
        self._body = np.array([place.body for place in places], dtype=np.intp)
        self._rest = np.concatenate([none[0], *(node.position[None] for node in nodes)])
        wide = [np.pad(part, ((0, 0), (0, modes - part.shape[1]))) for node in nodes for part in node[2:]]
        shapes = np.array(wide).reshape(len(nodes), 2, 3, modes)
        self._translation, self._rotation = shapes[:, 0], shapes[:, 1]
        self._arm = np.array([p.node.axes @ p.arm for p in places]).reshape(-1, 3)
        self._axes = np.array([p.node.axes @ p.axes for p in places]).reshape(-1, 3, 3)
        self._modes = modes
        self._deform = bool(shapes.any())
        self._still = self._rest + self._arm

    def at(self, bodies: FreeBodies) -> MovedFrames:
        """Their motion. With w the body's angular velocity, W etadot that of the node in it, and d the arm:

        velocity w x rho + phi etadot + (W etadot) x d beyond the origin's, W = J_l(theta) psi.
        """
        return self._on_deforming_nodes(bodies) if self._deform else self._on_rigid_nodes(bodies)

    def _on_rigid_nodes(self, bodies: FreeBodies) -> MovedFrames:
        own, rho = self._body, self._still
        R, w_ = bodies.rotation[own], skew(bodies.angular[own])
        moving = applied(w_, rho)
        partial = np.zeros((len(own), 6, 6 + self._modes))
        partial[:, :3, 3:6] = partial[:, 3:, :3] = R
        partial[:, 3:, 3:6] = -R @ skew(rho)
        velocity, remaining = np.empty((len(own), 6)), np.zeros((len(own), 6))
        velocity[:, :3] = applied(R, bodies.angular[own])
        velocity[:, 3:] = bodies.velocity[own] + applied(R, moving)
        remaining[:, 3:] = applied(R, applied(w_, moving))
        return MovedFrames(bodies.position[own] + applied(R, rho), R @ self._axes, velocity, partial, remaining)

    def _on_deforming_nodes(self, bodies: FreeBodies) -> MovedFrames:
        own = self._body
        R, w, eta, rate = bodies.rotation[own], bodies.angular[own], bodies.eta[own], bodies.rate[own]
        theta, turning = applied(self._rotation, eta), applied(self._rotation, rate)
        f = _functions((theta * theta).sum(1))[:, :, None]
        K = skew(theta)
        KK = K @ K
        exponential = np.eye(3) + f[:, 0, :, None] * K + f[:, 1, :, None] * KK
        W = (np.eye(3) + f[:, 1, :, None] * K + f[:, 2, :, None] * KK) @ self._rotation
        d = applied(exponential, self._arm)
        rho = self._rest + applied(self._translation, eta) + d
        spin = applied(W, rate)
        # The rate of J_l times thetadot: b and c change by 2 (theta . thetadot) per unit of s.
        ab, along = applied(K, turning), 2.0 * (theta * turning).sum(1)[:, None]
        changing = along * (f[:, 3] * ab + f[:, 4] * applied(K, ab)) + f[:, 2] * applied(skew(turning), ab)
        w_, spin_, d_ = skew(w), skew(spin), skew(d)
        lever = self._translation - d_ @ W
        moving = applied(lever, rate)
        partial = np.zeros((len(own), 6, 6 + self._modes))
        partial[:, :3, 3:6] = R
        partial[:, :3, 6:] = R @ W
        partial[:, 3:, :3] = R
        partial[:, 3:, 3:6] = -R @ skew(rho)
        partial[:, 3:, 6:] = R @ lever
        angular = applied(R, w + spin)
        linear = bodies.velocity[own] + applied(R, applied(w_, rho) + moving)
        left_angular = applied(R, changing + applied(w_, spin))
        left = applied(w_, applied(w_, rho) + 2.0 * moving) - applied(d_, changing) + applied(spin_, applied(spin_, d))
        return MovedFrames(
            bodies.position[own] + applied(R, rho), R @ exponential @ self._axes,
            np.concatenate([angular, linear], axis=1), partial,
            np.concatenate([left_angular, applied(R, left)], axis=1),
        )  # fmt: skip
