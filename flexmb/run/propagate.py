"""Compiled runs: the integrators applied to the equations of motion. Here the two rooms meet; nothing else happens."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from flexmb.entry import articulated, tangent
from flexmb.integrate.problem import Clock, Problem, problem, stiff_problem
from flexmb.integrate.settings import Settings
from flexmb.motion import coordinates, retraction
from flexmb.tables.arrays import Constants
from flexmb.typing import Index, Real


class Route(NamedTuple):
    """An algorithm as runs see it: a maker of constants and workspace, kernels of the motion and of its manifold."""

    tables: Callable[[], tuple[Any, Any]]
    rhs: Any = articulated.rhs
    project: Any = coordinates.project


def recursion(constants: Constants, workspace: Any) -> Problem:
    """The equations of motion by the recursion."""
    return problem(articulated.rhs, coordinates.project, constants, workspace)


class Integration:
    """An integrator with a problem and a workspace of its own, ready to be called."""

    def __init__(self, route: Route, settings: Settings, exact: Constants, nq: int, nu: int) -> None:
        """exact: the constants with every body eliminated explicitly, for Jacobians."""
        constants, self._workspace = route.tables()
        self._integrator, self._accuracy = settings.integrator, settings.accuracy(nq, nu)
        motion = route.rhs, route.project, constants, self._workspace
        if self._integrator.linearises:
            moving = tangent.tangent_workspace(exact, nq, nu)
            self._problem: Any = stiff_problem(*motion, tangent.jacobian, retraction.move, exact, moving)
        else:
            self._problem = problem(*motion)

    def __call__(self, y: Real, clock: Clock, out: Real, counts: Index) -> tuple[int, float]:
        """Integrate y (nq+nu+1,) = [q, u, work]; see `Integrator`."""
        return self._integrator.run(self._problem, y, clock, self._accuracy, out, counts)

    @property
    def fault(self) -> int:
        """Where an evaluation failed."""
        return int(self._workspace.fault[0])
