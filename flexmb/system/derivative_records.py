"""Derivatives at one state, by the names of the scene.

Columns are those of nu speeds, in the order of u; those of prescribed coordinates and speeds vanish, because both are
functions of time. `docs/derivatives.md` says what is held fixed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from flexmb.entry.observation import parts
from flexmb.entry.variation import ByAllDirections, displacement_of
from flexmb.kept import kept
from flexmb.system.observables import ENERGIES, PARTS, Observation
from flexmb.tables.named import brief, name_parts
from flexmb.typing import Real


class OfFreeMotion(NamedTuple):
    """Derivatives of a quantity (...) of the free motion, whose accelerations change with the state.

    by_displacement (...,nu): along the speeds, as `AccelerationDerivatives.by_displacement`; by_speed (...,nu);
    by_force (...,nu): by generalised forces along the speeds (N m, N), in addition to all others; by_time (...): with
    all coordinates and speeds held but the prescribed ones. Pushforward a motion a quantity changes at the rate
    by_displacement u + by_speed udot + by_time.
    """

    by_displacement: Real
    by_speed: Real
    by_force: Real
    by_time: Real


class OfGivenMotion(NamedTuple):
    """The same for a motion with given accelerations (nu,), by which the last derivatives are."""

    by_displacement: Real
    by_speed: Real
    by_acceleration: Real
    by_time: Real


class OfControlledMotion(NamedTuple):
    """The same for the motion under continuous controllers, whose forces change with the state; by_states (...,X): by
    the states of the controllers."""

    by_displacement: Real
    by_speed: Real
    by_states: Real
    by_force: Real
    by_time: Real


By = TypeVar("By", OfFreeMotion, OfGivenMotion, OfControlledMotion)


@dataclass(frozen=True, eq=False)
class AccelerationDerivatives:
    """Derivatives of the accelerations (nu,) of the free motion, udot.

    by_displacement (nu,nu): by displacements along the speeds, the motions that unit speeds would make in a unit of
    time: of a scalar coordinate, a mode or a wheel its change, of a quaternion a small rotation (rad) in outboard axes,
    of the origin of a free hinge a displacement (m) in outboard axes. by_speed (nu,nu); by_force (nu,nu): by
    generalised forces, M^-1 in a tree; by_time (nu,). motion (nq,nu): dq of displacements.
    """

    accelerations: Real
    by_displacement: Real
    by_speed: Real
    by_force: Real
    by_time: Real
    motion: Real

    __repr__ = brief

    @classmethod
    def known(cls, accelerations: Real, of: ByAllDirections, motion: Real) -> AccelerationDerivatives:
        """The same record. The constructor of a frozen dataclass sets each field by a call of its own, which together
        take as long as a fifth of the evaluation of a chain of ten."""
        found = object.__new__(cls)
        found.__dict__.update(
            accelerations=accelerations, by_displacement=of.by_displacement, by_speed=of.by_speed,
            by_force=of.by_force, by_time=of.by_time, motion=motion,
        )  # fmt: skip
        return found

    @kept
    def by_coordinates(self) -> Real:
        """(nu,nq) by the entries of q, with quaternions normalised: by_displacement = by_coordinates @ motion."""
        return np.asarray(self.by_displacement @ displacement_of(self.motion))


@dataclass(frozen=True, eq=False)
class InverseDynamicsDerivatives:
    """Derivatives of tau (nu,) = M udot + c, with `by_acceleration` = M (nu,nu); the others as of accelerations."""

    tau: Real
    by_displacement: Real
    by_speed: Real
    by_acceleration: Real
    by_time: Real
    motion: Real

    __repr__ = brief

    @kept
    def by_coordinates(self) -> Real:
        """(nu,nq), as of accelerations."""
        return np.asarray(self.by_displacement @ displacement_of(self.motion))


@dataclass(frozen=True, eq=False)
class MarkerDerivatives(Generic[By]):
    """Derivatives of a marker's motion, World axes: position (3,...), velocity and acceleration (6,...) as in
    `MarkerMotion`; orientation (3,...) as small rotations (rad) of the marker in World axes."""

    position: By
    orientation: By
    velocity: By
    acceleration: By


@dataclass(frozen=True, eq=False)
class EvaluationDerivatives(Generic[By]):
    """Derivatives of everything that an `Evaluation` has, by the same names: rows are those of the value.

    NaN where the motion does not determine the value, as of loads of redundant closures.
    """

    accelerations: By
    markers: dict[str, MarkerDerivatives[By]]
    loads: dict[str, By]
    wheel_loads: dict[str, By]
    drives: dict[str, By]
    energy: dict[str, By]
    momentum: By
    connectors: dict[str, By]
    hinge_forces: dict[str, By]

    __repr__ = brief

    def __post_init__(self) -> None:
        name_parts(self, PARTS)


def by_names(
    observation: Observation, row: Real, change: Real, split: Callable[[Real], By]
) -> EvaluationDerivatives[By]:
    """From a row (E,) and its derivatives (E,k); `split` makes those (...,k) of one quantity a record."""
    names, k = observation.names, change.shape[-1]
    now = parts(row, observation.columns)
    changes = {name: change[at].reshape(*shape, k) for name, (at, shape) in observation.columns.items()}

    along = names.along_hinges(changes["hinge_forces"].T, changes["drives"].T)

    def each(group: Iterable[str], part: str) -> dict[str, By]:
        return {name: split(changes[part][i]) for i, name in enumerate(group)}

    return EvaluationDerivatives(
        accelerations=split(changes["rates"]),
        markers={
            name: _of_marker(now["markers"][i, 3:12], changes["markers"][i], split)
            for i, name in enumerate(names.markers)
        },
        loads=each(names.hinges, "loads") | each(names.closures, "closures"),
        wheel_loads=each(names.wheels, "wheel_loads"),
        drives={name: split(changes["drives"][places]) for name, places in names.driven.items()},
        energy=each(ENERGIES, "energy"),
        momentum=split(changes["momentum"]),
        connectors=each(names.connectors, "connectors"),
        hinge_forces={name: split(rows.T) for name, rows in along.items()},
    )


def _of_marker(rotation: Real, change: Real, split: Callable[[Real], By]) -> MarkerDerivatives[By]:
    """rotation (9,) R; change (24,k) of a marker's row. A small rotation theta changes R by theta~ R."""
    turn = np.einsum("ijk,lj->ilk", change[3:12].reshape(3, 3, -1), rotation.reshape(3, 3))
    small = 0.5 * np.stack([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return MarkerDerivatives(split(change[:3]), split(small), split(change[12:18]), split(change[18:]))
