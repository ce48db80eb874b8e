"""Rows of planar four-bars, of one freedom, and their motion by a way that shares nothing with runs.

Bars lie in a plane and are known by their angles against the x axis: feet of uprights are fixed on the ground, and
sill i goes from the top of upright i to that of upright i + 1. Which lengths are equal decides what is singular:
parallelograms, kites, anything whose shortest and longest bar together are as long as the other two.

The reference knows a curve of angles, K(x) = 0, and moves along it: in a patch around a point x0 with tangent n the
coordinate is s = n . (x - x0), what else there is of x is found by Newton's method, and the equation of motion of s is
integrated. Patches are short beside the distance to where the curve nearly branches; where it is known to branch
exactly, a patch goes straight over that place, as momentum demands.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from flexmb.scene.build import SceneBuilder, s

Array = np.ndarray
PATCH = 0.2  # of the distance to a branch that is only nearly one
ACROSS = 1e-2  # rad, a patch that goes over one
PATCHES = 4000  # after so many the reference gives up: rows of rhombi may stay near singular positions for good
STEPS = 8  # of the classical Runge-Kutta method in a patch


@dataclass(frozen=True)
class Row:
    """N four-bars side by side."""

    feet: Array  # (N+1,) x of the uprights' feet (m)
    uprights: Array  # (N+1,) lengths (m)
    sills: Array  # (N,) lengths (m)
    mass: Array  # (2N+1,) kg, uprights before sills
    angles: Array  # (2N+1,) rad, closed
    rates: Array  # (2N+1,) rad/s, consistent
    gravity: float  # m/s^2 along y
    closure: str = "revolute"

    @property
    def lengths(self) -> Array:
        """(2N+1,) m."""
        return np.concatenate([self.uprights, self.sills])

    @property
    def arms(self) -> Array:
        """(2N+1,2N+1) m: how far along bar j the centre of bar i lies, on its way from the ground."""
        n = len(self.sills)
        arms, i = np.diag(0.5 * self.lengths), np.arange(n)
        arms[n + 1 + i, i] = self.uprights[:-1]
        return arms

    @property
    def numbers(self) -> tuple:
        """What kernels ask for: distances of feet, lengths, inertia of bars and of their arms, weights' moments."""
        arms = self.arms
        products = arms.T @ (self.mass[:, None] * arms)
        turned = np.diag(self.mass * self.lengths**2 / 12.0)
        return np.diff(self.feet), self.lengths, turned, products, self.gravity * (self.mass @ arms)

    @property
    def kinetic(self) -> float:
        """Energy (J) of motion at the start."""
        return kinetic(self, self.angles, self.rates)

    def energy(self, x: Array, rate: Array) -> float:
        """Kinetic and of height (J)."""
        return kinetic(self, x, rate) - float(self.numbers[-1] @ np.sin(x))

    def narrowness(self, x: Array) -> float:
        """The least singular value of dK/dx beside the largest: 0 where branches cross."""
        return float(_narrowness(x, *self.numbers[:2]))

    def tangent(self, x: Array) -> Array:
        """The direction (2N+1,) in which the bars can move, of length 1."""
        return np.linalg.svd(_jacobian(x, self.lengths, -np.sin(x), np.cos(x)))[2][-1]

    def closed(self, x: Array) -> Array:
        """The nearest angles that close all four-bars."""
        return _closed(x, self.tangent(x), 0.0, *self.numbers[:2])

    def motion(self, times: Array, *, exact: bool) -> tuple[Array, float]:
        """Angles (T,2N+1) at the times, and the largest change of energy beside the kinetic one at the start.

        Not numbers from where it gives up. `exact`: branches cross, they do not only nearly do so.
        """
        out, rates = _motion(times, self.angles, self.rates, self.tangent(self.angles), exact, *self.numbers)
        start = self.energy(self.angles, self.rates)
        changes = [abs(self.energy(*each) - start) for each in zip(out, rates, strict=True)]
        return out, float(np.max(changes)) / self.kinetic

    def scene(self) -> s.Scene:
        """Cut at the tops of all uprights but the first."""
        made = SceneBuilder("row of four-bars", gravity=(0.0, self.gravity, 0.0))
        n, x, u = len(self.sills), self.angles, self.rates
        names = [f"upright {i}" for i in range(n + 1)] + [f"sill {i}" for i in range(n)]
        for name, length, mass in zip(names, self.lengths, self.mass, strict=True):
            turned = mass * length**2 / 12.0
            made.rigid_body(
                name, mass=mass, com=(0.5 * length, 0, 0), inertia=(0.01 * turned, turned, turned),
                nodes={"tip": (length, 0, 0)},
            )  # fmt: skip
        for i in range(n + 1):
            made.revolute(
                f"foot {i}", "ground", f"upright {i}", parent_position=(self.feet[i], 0, 0), angle=x[i], rate=u[i]
            )
        turn = {}
        if self.closure == "universal":  # x of one frame stands on the plane, y of the other lies in it
            turn = {"quaternion_a": (np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0)}
        for i in range(n):
            j = n + 1 + i
            made.revolute(
                f"corner {i}", f"upright {i}", f"sill {i}", parent_node="tip", angle=x[j] - x[i], rate=u[j] - u[i]
            )
            made.closure(
                f"window {i}", self.closure, f"sill {i}", f"upright {i + 1}", node_a="tip", node_b="tip", **turn
            )
        return made.scene()


def kinetic(row: Row, x: Array, rate: Array) -> float:
    """Energy (J) of rates at the angles x."""
    return float(0.5 * rate @ _mass(x, *row.numbers[2:4]) @ rate)


@njit(cache=True)
def _constraint(x, apart, lengths):
    """K (2N,): sills end at the tops of the next uprights (m)."""
    n = apart.shape[0]
    along, across = lengths * np.cos(x), lengths * np.sin(x)
    found = np.empty(2 * n)
    for i in range(n):
        found[i] = apart[i] + along[i + 1] - along[i] - along[n + 1 + i]
        found[n + i] = across[i + 1] - across[i] - across[n + 1 + i]
    return found


@njit(cache=True)
def _jacobian(x, lengths, along, across):
    """dK/dx (2N,2N+1), along = -sin x, across = cos x; with their rates instead, its rate."""
    n = x.shape[0] // 2
    J = np.zeros((2 * n, 2 * n + 1))
    for i in range(n):
        for j, sign in ((i, -1.0), (i + 1, 1.0), (n + 1 + i, -1.0)):
            J[i, j], J[n + i, j] = sign * lengths[j] * along[j], sign * lengths[j] * across[j]
    return J


@njit(cache=True)
def _mass(x, turned, products):
    n = x.shape[0]
    M = turned.copy()
    for i in range(n):
        for j in range(n):
            M[i, j] += products[i, j] * np.cos(x[i] - x[j])
    return M


@njit(cache=True)
def _narrowness(x, apart, lengths):
    found = np.linalg.svd(_jacobian(x, lengths, -np.sin(x), np.cos(x)))[1]
    return found[-1] / found[0]


@njit(cache=True)
def _bordered(x, n, lengths):
    J = np.empty((x.shape[0], x.shape[0]))
    J[:-1] = _jacobian(x, lengths, -np.sin(x), np.cos(x))
    J[-1] = n
    return J


@njit(cache=True)
def _closed(x, n, ahead, apart, lengths):
    """The closed angles ahead of x along n, near x + n ahead."""
    found, error = x + n * ahead, np.empty(x.shape[0])
    for _ in range(20):
        error[:-1] = _constraint(found, apart, lengths)
        error[-1] = np.dot(n, found - x) - ahead
        if np.max(np.abs(error)) < 1e-15:
            break
        found = found - np.linalg.solve(_bordered(found, n, lengths), error)
    return found


@njit(cache=True)
def _along(x, n, lengths):
    """T = dx/ds (2N+1,)."""
    right = np.zeros(x.shape[0])
    right[-1] = 1.0
    return np.linalg.solve(_bordered(x, n, lengths), right)


@njit(cache=True)
def _slope(y, x0, n, apart, lengths, turned, products, weights):
    """d/dt of s and its rate: T' (M (T s'' + T' s'^2) - forces) = 0."""
    x = _closed(x0, n, y[0], apart, lengths)
    T = _along(x, n, lengths)
    rate = T * y[1]
    right = np.zeros(x.shape[0])
    right[:-1] = -_jacobian(x, lengths, -np.cos(x) * rate, -np.sin(x) * rate) @ rate
    bent = np.linalg.solve(_bordered(x, n, lengths), right)
    M = _mass(x, turned, products)
    force = weights * np.cos(x) - M @ bent
    for i in range(x.shape[0]):
        for j in range(x.shape[0]):
            force[i] -= products[i, j] * np.sin(x[i] - x[j]) * rate[j] ** 2
    return np.array([y[1], np.dot(T, force) / np.dot(T, M @ T)])


@njit(cache=True)
def _motion(times, x, u, n, exact, apart, lengths, turned, products, weights):
    t, sample, patches = times[0], 0, 0
    out, rates = np.full((times.shape[0], x.shape[0]), np.nan), np.full((times.shape[0], x.shape[0]), np.nan)
    while sample < times.shape[0] and patches < PATCHES:
        patches += 1
        longest = PATCH * _narrowness(x, apart, lengths)
        if exact:
            longest = max(longest, ACROSS)
        y = np.array([0.0, np.dot(n, u)])
        pull = abs(_slope(y, x, n, apart, lengths, turned, products, weights)[1])
        end = min(t + longest / (abs(y[1]) + np.sqrt(pull * longest) + 1e-6), times[sample])
        assert end > t or times[sample] == times[0]
        h = (end - t) / STEPS
        for _ in range(STEPS):
            k1 = _slope(y, x, n, apart, lengths, turned, products, weights)
            k2 = _slope(y + 0.5 * h * k1, x, n, apart, lengths, turned, products, weights)
            k3 = _slope(y + 0.5 * h * k2, x, n, apart, lengths, turned, products, weights)
            k4 = _slope(y + h * k3, x, n, apart, lengths, turned, products, weights)
            y = y + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        x, t = _closed(x, n, y[0], apart, lengths), end
        T = _along(x, n, lengths)
        u, n = T * y[1], T / np.sqrt(np.dot(T, T))
        if t == times[sample]:
            out[sample], rates[sample] = x, u
            sample += 1
    return out, rates
