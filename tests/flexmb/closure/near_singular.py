"""Random rows of four-bars whose branches cross, or nearly do: every kind of equal lengths, masses over decades."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from tests.flexmb.closure.one_freedom import Row, kinetic

Array = np.ndarray
PARALLEL = ("parallelogram", "folded", "rhombus")  # rows of these may be long
KINDS = (*PARALLEL, "kite", "dart", "change point")
CLOSURES = ("revolute", "revolute", "spherical", "universal", "cylindrical")


def random_row(rng: Generator) -> tuple[Row, float]:
    """A row that moves, far from singular positions at the start, and the largest relative error of its sills.

    Without an error, in three of ten, its branches cross exactly. Others are between 1e-11 and 1e-2.
    """
    kind = str(rng.choice(KINDS))
    count = int(rng.choice([1, 1, 1, 2, 3, 5])) if kind in PARALLEL else 1
    error = 0.0 if rng.random() < 0.3 else 10.0 ** rng.uniform(-11.0, -2.0)
    speed, gravity = 10.0 ** rng.uniform(-0.5, 0.6), float(rng.choice([0.0, -9.81]))
    mass = 10.0 ** (float(rng.choice([0.0, 1.0, 2.0, 3.0])) * rng.uniform(-1.0, 1.0, 2 * count + 1))
    uprights, sills, apart = _lengths(kind, count, rng)
    sills = sills * (1.0 + error * rng.choice([-1.0, 1.0], count) * rng.uniform(0.5, 1.0, count))
    feet = np.append(0.0, np.cumsum(apart))
    still = np.zeros(2 * count + 1)
    row = Row(feet, uprights, sills, mass, still, still, gravity, str(rng.choice(CLOSURES)))
    while True:
        angles = _angles(row, kind, rng)
        if angles is not None and row.narrowness(angles) > 0.05 / count:
            break
    angles = row.closed(angles)
    n = row.tangent(angles) * rng.choice([-1.0, 1.0])
    row = replace(row, angles=angles, rates=n)
    return replace(row, rates=n * speed / uprights[0] * np.sqrt(0.5 * mass.sum() / kinetic(row, angles, n))), error


def _lengths(kind: str, count: int, rng: Generator) -> tuple[Array, Array, Array]:
    """Of uprights and sills, and distances of feet (m)."""
    a, b, c = rng.uniform(0.3, 0.6), rng.uniform(0.9, 1.2), rng.uniform(0.65, 0.85)
    if kind in PARALLEL:
        same = np.full(count, a if kind == "rhombus" else b)
        return np.full(count + 1, a), same, same
    uprights, sill, apart = {
        "kite": ((a, b), b, a), "dart": ((a, b), a, b), "change point": ((a, c), a + b - c, b),
    }[kind]  # fmt: skip
    return np.array(uprights), np.array([sill]), np.array([apart])


def _angles(row: Row, kind: str, rng: Generator) -> Array | None:
    """By a random direction of the first upright, each next one on one of two circles; None where they do not meet."""
    n = len(row.sills)
    angles = np.zeros(2 * n + 1)
    angles[0] = rng.uniform(0.0, 2.0 * np.pi)
    for i in range(n):
        top = np.array([row.feet[i], 0.0]) + row.uprights[i] * _direction(angles[i])
        foot = np.array([row.feet[i + 1], 0.0])
        d = np.linalg.norm(foot - top)
        e = (foot - top) / d
        ahead = (row.sills[i] ** 2 - row.uprights[i + 1] ** 2 + d**2) / (2.0 * d)
        beside = row.sills[i] ** 2 - ahead**2
        if beside <= 0.0:
            return None
        tops = [top + ahead * e + side * np.sqrt(beside) * np.array([-e[1], e[0]]) for side in (-1.0, 1.0)]
        if kind in PARALLEL:
            folded = kind == "folded" and i == 0
            tops.sort(key=lambda each: np.linalg.norm(each - foot - (top - [row.feet[i], 0.0])), reverse=folded)
        else:
            rng.shuffle(tops)
        angles[i + 1], angles[n + 1 + i] = (np.arctan2(*(tops[0] - start)[::-1]) for start in (foot, top))
    return angles


def _direction(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])
