"""Accelerations by articulated bodies: the O(N) recursion."""

from __future__ import annotations

from typing import Any

from flexmb.entry import articulated, derivatives, stiff_part
from flexmb.entry.observation import observe
from flexmb.integrate.problem import Linear, StiffKernels
from flexmb.motion import coordinates, retraction
from flexmb.system.algorithm import DynamicsAlgorithm, Route
from flexmb.system.mechanics import Mechanics

# Number of speeds from which implicit methods use the stiff part in place of the Jacobian, and no dense algebra. At 42
# speeds radau5 takes 0.87 of the time with the Jacobian, at 60 0.6, at 300 0.1 (chains of beams of 5 modes, measured).
MANY_SPEEDS = 40


def _fresh(system: Mechanics) -> tuple[Any, Any]:
    return system.explicit_constants, system.recursion_workspace()


def _in_full(system: Mechanics) -> tuple[Any, Any]:
    return system.recursion_constants, system.recursion_workspace()


def _linear(system: Mechanics) -> Linear:
    exact = system.constants  # with every body eliminated explicitly, for Jacobians
    written = derivatives.derivative_workspace(exact, system.nq, system.nu)
    return Linear(
        derivatives.jacobian, retraction.move, retraction.resolve, exact, written, stiff=_stiff(system)
    )  # fmt: skip


def _stiff(system: Mechanics) -> StiffKernels | None:
    """The stiff part of a scene for which it pays; None where stiff forces may act that it does not contain."""
    c = system.constants
    if system.nu < MANY_SPEEDS or not stiff_part.is_complete(c):
        return None
    tables = stiff_part.stiff_part(c, system.nq, system.nu)
    return StiffKernels(stiff_part.settle_at, stiff_part.shift, stiff_part.along, stiff_part.restore, tables)


def _route(system: Mechanics) -> Route:
    return Route(
        lambda: _in_full(system), articulated.rhs, coordinates.project, explicit=lambda: _fresh(system),
        linear=lambda *_: _linear(system),
    )  # fmt: skip


ALGORITHM = DynamicsAlgorithm(
    "articulated",
    "the O(N) recursion",
    lambda: articulated.accelerations,
    lambda system: (system.explicit_constants, system.own_recursion_workspace),
    _fresh,
    Mechanics.observe_recursion,
    route=_route,
    observing=observe,
    closed_motion=lambda closures, t, y: closures.motion(t, y),
    jacobian=True,
)
