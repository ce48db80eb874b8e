"""The declaration that the file of a hinge makes of its kind, and what most kinds have in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.scene.schema import Hinge, PointMass, Vector
from flexmb.scene.tree import coordinates
from flexmb.tables.arrays import NO_AXIS
from flexmb.typing import Real

Item = Hinge | PointMass
Names = list[tuple[str, str]]


class Reduced(NamedTuple):
    """A hinge of a scene as its kernels take it.

    `sequence` holds the axis numbers of a gimbal, `parameters` the kind's real numbers, at most three of each; `turn`
    (3,3) turns both hinge frames, so that a single axis is z.
    """

    sequence: tuple[int, ...] = ()
    turn: Real = np.eye(3)
    parameters: tuple[float, ...] = ()


def scalar_state(item: Item) -> tuple[list[float], list[float]]:
    """Initial values and rates of scalar coordinates (rad or m, per second)."""
    states = [c for _, c in coordinates(item)]
    return [c.value for c in states], [c.rate for c in states]


def scalar_names(item: Item) -> tuple[Names, Names]:
    """(name, unit) of scalar coordinates and of their rates, by their keys in the scene."""
    units = [(name, c.UNIT) for name, c in coordinates(item)]
    return units, [(f"{name}.rate", f"{unit}/s") for name, unit in units]


def no_ball(item: Any) -> tuple[float, float]:
    """No isotropic spring: stiffness and damping belong to scalar coordinates only."""
    return 0.0, 0.0


@helper
def nothing_turns(q, i, increment, j, result):
    """Without a quaternion `flexmb.motion.retraction` adds the increments itself, which is faster there."""


@helper
def nothing_to_resolve(q, i, u, x, j, how):
    """All speeds are rates of scalars, or those of a rotation, which is updated in its own axes."""


@dataclass(frozen=True, eq=False)
class HingeKind:
    """One kind of hinge. See `flexmb.hinges` for its kernels `pose`, `motion`, `rate`, `retract` and `resolve`.

    `reduced` gives the hinges and point masses of a scene that are of this kind in their kernels' terms, None for all
    others. `state` gives their initial coordinates and speeds, `names` the (name, unit) of both, `ball` stiffness
    (N m/rad) and damping (N m s/rad) of an isotropic spring on the first three speeds; its quaternion comes first.
    """

    name: str
    coordinates: int
    speeds: int
    pose: Callable[..., Any]
    motion: Callable[..., Any]
    rate: Callable[..., Any]
    retract: Callable[..., Any]
    reduced: Callable[[Item], Reduced | None]
    resolve: Callable[..., Any] = nothing_to_resolve
    axis: int = NO_AXIS  # of a single speed along z: ANGULAR_Z or LINEAR_Z
    quaternion: int = -1  # where it begins among the coordinates; -1 where there is none
    displacements: tuple[int, ...] = ()  # speeds (m/s); all others are angular
    state: Callable[[Any], tuple[list[float], list[float]]] = scalar_state
    names: Callable[[Any], tuple[Names, Names]] = scalar_names
    ball: Callable[[Any], tuple[float, float]] = no_ball


def scalar_hinge(
    name: str, freedoms: int, *, pose: Callable[..., Any], motion: Callable[..., Any],
    reduced: Callable[[Item], Reduced | None], axis: int = NO_AXIS, displacements: tuple[int, ...] = (),
) -> HingeKind:  # fmt: skip
    """A kind all of whose speeds are the rates of its coordinates."""

    @helper
    def rate(q, i, u, j, dq):
        for n in range(freedoms):
            dq[i + n] = u[j + n]

    return HingeKind(
        name, freedoms, freedoms, pose, motion, rate, nothing_turns, reduced, axis=axis, displacements=displacements
    )


def z_to(axis: Vector, like: Vector | None = None) -> Real:
    """A rotation whose third column is `axis`; around the axis `like`, if there is one, a smooth function of `axis`."""
    length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2])
    z = axis[0] / length, axis[1] / length, axis[2] / length
    sizes = [abs(component) for component in (z if like is None else like)]
    i = sizes.index(min(sizes))
    j, k = (i + 1) % 3, (i + 2) % 3
    beside = sqrt(z[j] * z[j] + z[k] * z[k])
    x = [0.0, 0.0, 0.0]  # e_i x z, to unit length
    x[j], x[k] = -z[k] / beside, z[j] / beside
    y = z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]
    return np.array([x, y, z]).T
