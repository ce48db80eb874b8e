"""Accelerations by articulated bodies: the O(N) recursion."""

from __future__ import annotations

from typing import Any

from flexmb.entry import articulated, derivatives
from flexmb.entry.observation import observe
from flexmb.integrate.problem import Linear
from flexmb.motion import coordinates, retraction
from flexmb.system.algorithm import DynamicsAlgorithm, Route
from flexmb.system.mechanics import Mechanics


def _fresh(system: Mechanics) -> tuple[Any, Any]:
    return system.recursion_constants, system.recursion_workspace()


def _linear(system: Mechanics) -> Linear:
    exact = system.constants  # with every body eliminated explicitly, for Jacobians
    written = derivatives.derivative_workspace(exact, system.nq, system.nu)
    return Linear(derivatives.jacobian, retraction.move, exact, written)


def _route(system: Mechanics) -> Route:
    return Route(lambda: _fresh(system), articulated.rhs, coordinates.project, linear=lambda *_: _linear(system))


ALGORITHM = DynamicsAlgorithm(
    "articulated",
    "the O(N) recursion",
    lambda: articulated.accelerations,
    lambda system: (system.recursion_constants, system.own_recursion_workspace),
    _fresh,
    Mechanics.observe_recursion,
    route=_route,
    observing=observe,
    closed_motion=lambda closures, t, y: closures.motion(t, y),
    jacobian=True,
)
