"""Plane rods as chains of point masses: the truth of the study of the advice, which shares nothing with flexmb.

Straight links with stretch EA join point masses. Where links meet, each turns against the frame of that corner by a
spring 2 EI / l, half a link's; a frame is massless and minimises its energy, is prescribed, or is a hub with inertia.
The error falls with the square of the links' length, and is taken out by Richardson's extrapolation (`extrapolated`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import ceil

import numpy as np
from numba import njit

from flexmb.typing import Real

Signal = Callable[[Real], Real]
Pull = Callable[[Real], tuple[Real, Real]]
STEP = 0.5
"""Step times the highest frequency, which must be below 2."""


@dataclass
class Corner:
    """A frame to which ends of links are fixed: `members` are (link, spring N m/rad, angle to the frame at rest).

    It turns freely and has no inertia, or has `inertia` and a `torque`, or a `given` angle.
    """

    members: list[tuple[int, float, float]] = field(default_factory=list)
    inertia: float = 0.0
    torque: Signal = np.zeros_like
    given: Signal | None = None


@dataclass
class Rods:
    """A net of links; `gravity` (2,) m/s²."""

    gravity: tuple[float, float] = (0.0, 0.0)
    places: list[tuple[float, float]] = field(default_factory=list)
    masses: list[float] = field(default_factory=list)
    held: dict[int, Pull] = field(default_factory=dict)
    links: list[tuple[int, int, float, float]] = field(default_factory=list)
    corners: list[Corner] = field(default_factory=list)
    forces: list[tuple[int, Pull]] = field(default_factory=list)

    def mass(self, x: float, y: float, mass: float = 0.0, held: Pull | None = None) -> int:
        """A point mass, perhaps held at a place that is a function of time; its number."""
        self.places.append((x, y))
        self.masses.append(mass)
        if held is not None:
            self.held[len(self.places) - 1] = held
        return len(self.places) - 1

    def link(self, a: int, b: int, length: float, EA: float, mass: float = 0.0) -> int:
        """A link without bending; half of its mass goes to each end."""
        self.links.append((a, b, length, EA))
        self.masses[a] += mass / 2.0
        self.masses[b] += mass / 2.0
        return len(self.links) - 1

    def rod(
        self, start: int, angle: float, length: float, count: int, *, EA: float, EI: float, m: float,
        curvature: float = 0.0, clamp: Corner | None = None, end: int | None = None,
    ) -> list[int]:  # fmt: skip
        """`count` links from `start`, which leave it at `angle`; their masses. `clamp`: the corner at the root."""
        step, chain, before = length / count, [start], -1
        x, y = self.places[start]
        for i in range(count):
            turned = angle + curvature * step * (i + 0.5)
            x, y = x + step * np.cos(turned), y + step * np.sin(turned)
            chain.append(end if end is not None and i == count - 1 else self.mass(x, y))
            here = self.link(chain[-2], chain[-1], step, EA, m * step)
            stiffness, half = 2.0 * EI / step, curvature * step / 2.0
            if i:
                self.corners.append(Corner([(before, stiffness, -half), (here, stiffness, half)]))
            elif clamp is not None:
                clamp.members.append((here, stiffness, half + angle))
            before = here
        return chain

    def run(self, times: Real) -> tuple[Real, Real, Real]:
        """Places (T,N,2), angles of hubs (T,C) and forces (T,N,2) on the masses at equidistant times, from rest."""
        places, masses, C = np.array(self.places), np.array(self.masses), len(self.corners)
        ends, sizes = np.array([link[:2] for link in self.links]), np.array([link[2:] for link in self.links])
        kinds = np.array([2 if corner.inertia else 1 if corner.given else 0 for corner in self.corners])
        members = [(i, *member) for i, corner in enumerate(self.corners) for member in corner.members]
        table = np.array(members, dtype=float).reshape(-1, 4)
        first = np.searchsorted(table[:, 0], np.arange(C + 1))
        each = ceil(float(times[1] - times[0]) * self._highest() / STEP)
        t = np.linspace(times[0], times[-1], each * (len(times) - 1) + 1)
        free = np.array([i not in self.held for i in range(len(places))])
        held = np.stack([np.stack(self.held[i](t), axis=1) for i in sorted(self.held)], axis=1)
        frames, torques = np.zeros((len(t), C)), np.zeros((len(t), C))
        for i, corner in enumerate(self.corners):
            torques[:, i] = corner.torque(t) if corner.inertia else 0.0
            frames[:, i] = corner.given(t) if corner.given else 0.0
        pushes = np.zeros((len(t), len(self.forces), 2))
        for i, (_, push) in enumerate(self.forces):
            pushes[:, i] = np.stack(push(t), axis=1)
        inertia = np.array([corner.inertia for corner in self.corners])
        pushed = np.array([node for node, _ in self.forces], dtype=np.intp)
        return _leapfrog(
            places, masses, free, np.array(sorted(self.held)), held, kinds, inertia, frames, torques, pushed, pushes,
            np.array(self.gravity), first, table[:, 1].astype(np.intp), table[:, 2:], ends, sizes, t[1] - t[0], each,
        )  # fmt: skip

    def _highest(self) -> float:
        """A bound of the highest frequency (rad/s), of neighbours that move against one another."""
        found = 0.0
        stiffness = {link: k for corner in self.corners for link, k, _ in corner.members}
        for i, (a, b, length, EA) in enumerate(self.links):
            least = min(self.masses[end] for end in (a, b) if end not in self.held)
            found = max(found, 4.0 * EA / length / least, 8.0 * stiffness.get(i, 0.0) / length**2 / least)
        return float(np.sqrt(found))


@njit(cache=True)
def _leapfrog(  # type: ignore[no-untyped-def]
    place, mass, free, held_nodes, held, kinds, inertia, frames, torques, pushed, pushes, gravity, first, link, spring,
    ends, sizes, step, each,
):  # fmt: skip
    """Kicks and drifts of `step` (s); every one of `each` is kept."""
    count, N, C = (len(frames) - 1) // each + 1, len(place), len(kinds)
    places, angles, forces = np.empty((count, N, 2)), np.zeros((count, C)), np.empty((count, N, 2))
    speed, turning, hub = np.zeros((N, 2)), np.zeros(C), np.zeros(C)
    for i in range(len(frames)):
        if i:
            place += step * speed
            hub += step * turning
        for j in range(len(held_nodes)):
            place[held_nodes[j]] = held[i, j]
        force, torque = _forces(place, np.where(kinds == 2, hub, frames[i]), kinds, first, link, spring, ends, sizes)
        for j in range(len(pushed)):
            force[pushed[j]] += pushes[i, j]
        if i % each == 0:
            places[i // each], angles[i // each], forces[i // each] = place, hub, force
        whole = 1.0 if i else 0.5
        for j in range(N):
            if free[j]:
                speed[j] += whole * step * (force[j] / mass[j] + gravity)
        for j in range(C):
            if kinds[j] == 2:
                turning[j] += whole * step * (torque[j] + torques[i, j]) / inertia[j]
    return places, angles, forces


@njit(cache=True)
def _forces(place, frames, kinds, first, link, spring, ends, sizes):  # type: ignore[no-untyped-def]
    """Forces (N,2) of links on masses, torques (C,) on the frames of corners. `kinds`: 0 for frames that are free."""
    angle = np.empty(len(ends))
    force, moment, torque = np.zeros_like(place), np.zeros(len(ends)), np.zeros(len(kinds))
    for i in range(len(ends)):
        a, b = ends[i, 0], ends[i, 1]
        angle[i] = np.arctan2(place[b, 1] - place[a, 1], place[b, 0] - place[a, 0])
    for i in range(len(kinds)):
        frame = frames[i] if kinds[i] else angle[link[first[i]]] - spring[first[i], 1]
        mean, total = 0.0, 0.0
        for j in range(first[i], first[i + 1]):
            total += spring[j, 0]
            mean += spring[j, 0] * _wrapped(angle[link[j]] - frame - spring[j, 1])
        for j in range(first[i], first[i + 1]):
            bent = _wrapped(angle[link[j]] - frame - spring[j, 1]) - (0.0 if kinds[i] else mean / total)
            moment[link[j]] += spring[j, 0] * bent
            torque[i] += spring[j, 0] * bent
    for i in range(len(ends)):
        a, b = ends[i, 0], ends[i, 1]
        x, y = place[b, 0] - place[a, 0], place[b, 1] - place[a, 1]
        length = np.hypot(x, y)
        pull, across = sizes[i, 1] * (length / sizes[i, 0] - 1.0) / length, moment[i] / length**2
        for end, sign in ((a, 1.0), (b, -1.0)):
            force[end, 0] += sign * (pull * x - across * y)
            force[end, 1] += sign * (pull * y + across * x)
    return force, torque


@njit(cache=True)
def _wrapped(angle: float) -> float:
    """Between -pi and pi."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def extrapolated(of: Callable[[int], Real], count: int) -> tuple[Real, Real]:
    """The values of `of` links without their error of second order, from `count` and twice as many; and how much the
    finer ones were off."""
    coarse, fine = of(count), of(2 * count)
    return fine + (fine - coarse) / 3.0, np.abs(fine - coarse) / 3.0
