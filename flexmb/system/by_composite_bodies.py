"""Accelerations by composite bodies: the mass matrix, inverse dynamics, and Cholesky's factors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from flexmb.entry import composite
from flexmb.entry.observation import Outputs
from flexmb.jain.places import matrices
from flexmb.motion import coordinates
from flexmb.system.algorithm import DynamicsAlgorithm, Route
from flexmb.system.mechanics import Mechanics
from flexmb.typing import Real

if TYPE_CHECKING:
    from flexmb.closure.closures import ClosedMotion, Closures


def _accelerations(system: Mechanics, t: float, y: Real) -> Real:
    """Drive loads are left in w.speed.drive."""
    system._check(composite.accelerations(t, y, system.constants, system._w, system._places()))
    system._trust(t, y, system._w)
    return system._w.speed["acceleration"].copy()


def _observe(system: Mechanics, t: float, y: Real, out: Outputs) -> None:
    out.rates[:], out.drives[:] = _accelerations(system, t, y), system._w.speed["drive"]
    system._observe_forced(t, y, out)


def _tables(system: Mechanics) -> tuple[Any, ...]:
    return system.constants, system.workspace(), matrices(system.constants)


def _closed_motion(closures: Closures, t: float, y: Real) -> ClosedMotion:
    return closures.composite_motion(t, y)


ALGORITHM = DynamicsAlgorithm(
    "composite",
    "the mass matrix and its Cholesky factors",
    _accelerations,
    _observe,
    kernel=lambda system: (composite.accelerations, _tables(system)),
    route=lambda system: Route(
        lambda: (system.constants, system.composite_workspace()), composite.rhs, coordinates.project
    ),
    closed_motion=_closed_motion,
)
