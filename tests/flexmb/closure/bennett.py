"""Bennett's linkage with links of nearly one length, and its motion by a quadrature that shares nothing with runs.

Links of lengths a and b = (1 - shorter) a between skew axes; two of the five rows of its closure are independent. With
half angles A and B of neighbouring joints, tan A tan B = k, sum and difference are related by

    cos(A + B) = -(1 - e) cos(A - B),   e = 2/(k + 1).

The difference is one smooth coordinate for the whole motion. Where it is a multiple of pi all bars lie on one line: at
e = 0 two branches cross, on each of which one joint alone turns; with any other e the joints take turns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from flexmb.scene.build import SceneBuilder, s

Array = np.ndarray
HALVINGS = 44  # of panels of the quadrature towards where all bars lie on one line: below 1e-12
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class Bennett:
    """Link 1 of length b, link 2 of length a, link 3 of length b; the ground is the fourth, of length a."""

    a: float  # m
    shorter: float
    alpha: float  # rad, twist of links of length a
    mass: Array  # (3,) kg
    com: Array  # (3,3) m, in link axes: z the inboard joint, x along the link
    difference: float  # A - B at the start, rad
    speed: float  # energy of motion at the start, beside what gravity may take from it
    gravity: Array  # (3,) m/s^2

    @property
    def lengths(self) -> Array:
        """(3,) m, of the links that move."""
        b = self.a * (1.0 - self.shorter)
        return np.array([b, self.a, b])

    @property
    def untwisted(self) -> float:
        """By how much the other twist is less than alpha: sin(alpha - it) = (1 - shorter) sin(alpha)."""
        x = 0.0
        for _ in range(10):  # Newton's method keeps the digits of small differences, which arcsin loses
            lacking = self.shorter * np.sin(self.alpha)
            value = 2.0 * np.cos(self.alpha - 0.5 * x) * np.sin(0.5 * x) - lacking
            x -= value / np.cos(self.alpha - x)
        return x

    @property
    def twists(self) -> Array:
        """(3,) rad."""
        beta = self.alpha - self.untwisted
        return np.array([beta, self.alpha, beta])

    @property
    def apart(self) -> float:
        """e: 0 where branches cross."""
        less = self.untwisted
        small, large = np.sin(0.5 * less), np.sin(self.alpha - 0.5 * less)
        return 2.0 * small / (large + small)

    def angles(self, d: Array) -> tuple[Array, Array]:
        """Angles (3,n) of the tree's joints where A - B is d, and their derivatives by d."""
        e, one = self.apart, np.ones_like(d)
        if e == 0.0:
            total, slope = np.pi - d, -one
        else:
            sine = np.sqrt(np.sin(d) ** 2 + e * (2.0 - e) * np.cos(d) ** 2)
            total, slope = np.arctan2(sine, -(1.0 - e) * np.cos(d)), -(1.0 - e) * np.sin(d) / sine
        return np.array([total + d, total - d, -total - d]), np.array([slope + one, slope - one, -slope - one])

    def links(self, d: Array) -> Iterator[tuple[Array, Rotation, Array, Array]]:
        """Of every link, and of the axis behind the last, where it begins, its axes and, for a unit rate of A - B, its
        velocities (angular, of the beginning); of that axis before it is turned about."""
        R, place = Rotation.identity(len(d)), np.zeros((len(d), 3))
        omega, velocity = np.zeros_like(place), np.zeros_like(place)
        for angle, rate, length, twist in zip(*self.angles(d), self.lengths, self.twists, strict=True):
            R = R * Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0])
            omega = omega + rate[:, None] * R.apply([0.0, 0.0, 1.0])
            yield place, R, omega, velocity
            link = R.apply([length, 0.0, 0.0])
            place, velocity = place + link, velocity + np.cross(omega, link)
            R = R * Rotation.from_euler("x", twist)
        yield place, R, omega, velocity

    def energies(self, d: Array) -> tuple[Array, Array]:
        """Kinetic energy for a unit rate of A - B, and that of gravity (J), each (n,)."""
        kinetic, weight = np.zeros_like(d), np.zeros_like(d)
        for mass, com, inertia, link in zip(self.mass, self.com, self.inertia, self.links(d), strict=False):
            place, R, omega, velocity = link
            arm, turning = R.apply(com), R.inv().apply(omega)
            kinetic += 0.5 * mass * np.sum((velocity + np.cross(omega, arm)) ** 2, axis=1) + 0.5 * turning**2 @ inertia
            weight -= mass * (place + arm) @ self.gravity
        return kinetic, weight

    @property
    def inertia(self) -> Array:
        """(3,3) kg m^2, moments about the mass centres."""
        return self.mass[:, None] * self.lengths[:, None] ** 2 * np.array([0.01, 0.1, 0.1])

    @property
    def rate(self) -> float:
        """Of A - B at the start (rad/s), by which it never stops."""
        around = np.linspace(0.0, 2.0 * np.pi, 400)
        weight = self.energies(around)[1]
        kinetic, start = (float(energy[0]) for energy in self.energies(np.array([self.difference])))
        moves = self.speed**2 * float(np.sum(self.mass)) * self.a**2 + 1.5 * (np.max(weight) - start)
        return np.sqrt(moves / kinetic)

    @property
    def kinetic(self) -> float:
        """Energy (J) of motion at the start."""
        return float(self.energies(np.array([self.difference]))[0][0]) * self.rate**2

    def motion(self, turns: float, count: int) -> tuple[Array, Array]:
        """Times (count,) from 0 on and angles (count,3), A - B going on by `turns` times pi in all."""
        ends = self.difference + np.pi * np.linspace(0.0, turns, count)
        kinetic, weight = self.energies(ends[:1])
        total = float(kinetic[0] * self.rate**2 + weight[0])
        passed = [0.0]
        for start, end in zip(ends[:-1], ends[1:], strict=True):
            panels = _panels(start, end)
            middle, half = 0.5 * (panels[1:] + panels[:-1]), 0.5 * np.diff(panels)
            kinetic, weight = self.energies((middle[:, None] + half[:, None] * NODES).ravel())
            slowness = np.sqrt(kinetic / (total - weight)).reshape(len(middle), -1)
            passed.append(passed[-1] + float(half @ (slowness @ WEIGHTS)))
        return np.array(passed), self.angles(ends)[0].T

    def scene(self) -> s.Scene:
        """Cut at its fourth axis."""
        made = SceneBuilder("Bennett", gravity=tuple(self.gravity))
        angles, rates = (angle[:, 0] for angle in self.angles(np.array([self.difference])))
        names = ("one", "two", "three")
        for k, name in enumerate(names):
            half = 0.5 * self.twists[k]
            tip = s.Node(name="tip", position_m=(self.lengths[k], 0, 0), quaternion=(np.cos(half), np.sin(half), 0, 0))
            made.rigid_body(
                name, mass=self.mass[k], com=tuple(self.com[k]), inertia=np.diag(self.inertia[k]), nodes=[tip]
            )
            at = {"parent_node": "tip"} if k else {}
            made.revolute(
                f"joint {name}", names[k - 1] if k else "ground", name, angle=angles[k], rate=self.rate * rates[k], **at
            )
        half = 0.5 * self.alpha
        made.closure(
            "fourth", "revolute", "three", "ground", node_a="tip", position_b=(-self.a, 0, 0),
            quaternion_b=(np.cos(half), -np.sin(half), 0, 0),
        )  # fmt: skip
        return made.scene()


def _panels(start: float, end: float) -> Array:
    """From start to end, halved again and again towards the multiples of pi between and beside them."""
    corners = np.pi * np.arange(np.floor(start / np.pi), np.ceil(end / np.pi) + 1.0)
    steps = np.pi * 0.5 ** np.arange(1, HALVINGS)
    marks = np.concatenate([corners, *(corners + sign * step for step in steps for sign in (-1.0, 1.0))])
    return np.unique(np.concatenate([[start, end], marks[(marks > start) & (marks < end)]]))


def random_bennett(rng: Generator) -> Bennett:
    """One that never stops, with masses over decades; three of ten have links of one length exactly."""
    shorter = 0.0 if rng.random() < 0.3 else 10.0 ** rng.uniform(-11.0, -1.0)
    mass = 10.0 ** (float(rng.choice([0.0, 1.0, 2.0, 3.0])) * rng.uniform(-1.0, 1.0, 3))
    a = rng.uniform(0.5, 1.5)
    com = a * (np.array([0.5, 0.0, 0.0]) + rng.uniform(-0.05, 0.05, (3, 3)))
    gravity = float(rng.choice([0.0, 9.81])) * rng.uniform(-1.0, 1.0, 3)
    return Bennett(
        a, shorter, rng.uniform(0.4, 1.2), mass, com, rng.uniform(0.5, 1.2), 10.0 ** rng.uniform(-0.5, 0.6), gravity
    )
