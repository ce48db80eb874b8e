"""Derivatives of the accelerations of the clauses' trees: differences of Kane's equations, and the mass matrix.

Scalar coordinates are moved as they are. The quaternion of a ball joint or of free flight is turned about axes of its
outboard frame, and the origin of free flight is shifted along these, in the scene itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from msgspec.structs import replace

from crosscheck.conformance.tree_mechanics import TreeMechanics
from crosscheck.engines.conventions import rotation_matrix
from flexmb.scene.hinges import Free, Hinge, Spherical
from flexmb.scene.schema import Scene
from flexmb.typing import Real

STEP = 2e-3
"""Of differences of fourth order: its fourth power is 1.6e-11, and rounding divided by it 1e-13."""


class KnownDerivatives(NamedTuple):
    """d udot / d xi, d u and d tau (n,n) in the initial state."""

    by_displacement: Real
    by_speed: Real
    by_force: Real


def derivatives(scene: Scene) -> KnownDerivatives:
    """Those of a tree that `TreeMechanics` knows, without moving point masses; n is the number of free coordinates."""
    tree = TreeMechanics(scene)
    none = np.zeros(tree.size)
    displaced = list(_displaced(scene, tree))

    def hurried(n: int) -> Callable[[float], Real]:
        return lambda h: tree.accelerations(none, _only(n, h, tree.size))

    return KnownDerivatives(
        np.array([_slope(displaced[n]) for n in tree.free]).T,
        np.array([_slope(hurried(n)) for n in tree.free]).T,
        np.asarray(np.linalg.inv(tree.mass_matrix())),
    )


def _displaced(scene: Scene, tree: TreeMechanics) -> Iterator[Callable[[float], Real]]:
    """For every coordinate the accelerations as a function of its displacement."""
    none = np.zeros(tree.size)

    def shifted(n: int) -> Callable[[float], Real]:
        return lambda h: tree.accelerations(_only(n, h, tree.size), none)

    def moved(number: int, axis: int) -> Callable[[float], Real]:
        def found(h: float) -> Real:
            hinges = list(scene.hinges)
            hinges[number] = _moved(hinges[number], _only(axis, h, 6))
            return TreeMechanics(replace(scene, hinges=tuple(hinges))).accelerations(none, none)

        return found

    n = 0
    for number, hinge in enumerate(scene.hinges):
        for freedom in hinge.freedoms:
            count = freedom.sizes[1]
            alone = count == 1
            yield from (shifted(n) for _ in range(count)) if alone else (moved(number, k) for k in range(count))
            n += count
    yield from (shifted(k) for k in range(n, tree.size))  # wheels and modes


def _moved(hinge: Hinge, xi: Real) -> Spherical | Free:
    """A ball joint or free flight turned and shifted by xi (6,) [rotation; position] in its outboard axes."""
    assert isinstance(hinge, Spherical | Free)  # no other has a freedom of several speeds
    w, x, y, z = hinge.quaternion
    angle = float(np.linalg.norm(xi[:3]))
    a, (b, c, d) = np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * xi[:3]
    turned = (
        w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a,
    )  # fmt: skip
    found = replace(hinge, quaternion=tuple(map(float, turned)))
    if isinstance(found, Free):
        shifted = np.array(found.position_m) + rotation_matrix(hinge.quaternion) @ xi[3:]
        found = replace(found, position_m=tuple(map(float, shifted)))
    return found


def _only(n: int, h: float, size: int) -> Real:
    found = np.zeros(size)
    found[n] = h
    return found


def _slope(f: Callable[[float], Real]) -> Real:
    near, far = f(STEP) - f(-STEP), f(2.0 * STEP) - f(-2.0 * STEP)
    return np.asarray((8.0 * near - far) / (12.0 * STEP))
