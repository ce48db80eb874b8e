"""Compiled runs: the integrators applied to the equations of motion. Here the two rooms meet; nothing else happens."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from flexmb.entry import articulated, tangent
from flexmb.integrate.dop853 import dop853
from flexmb.integrate.exponential import exponential
from flexmb.integrate.generalised_alpha import generalised_alpha
from flexmb.integrate.problem import Problem, problem, stiff_problem
from flexmb.integrate.radau5 import radau5
from flexmb.integrate.rk4 import rk4
from flexmb.integrate.settings import LINEARISING, Settings
from flexmb.motion import coordinates, retraction
from flexmb.tables.arrays import Constants
from flexmb.typing import Index, Real

_ADAPTIVE = {"dop853": dop853, "radau5": radau5, "exponential": exponential}


class Route(NamedTuple):
    """An algorithm as runs see it: a maker of constants and workspace, kernels of the motion and of its manifold."""

    tables: Callable[[], tuple[Any, Any]]
    rhs: Any = articulated.rhs
    project: Any = coordinates.project


def recursion(constants: Constants, workspace: Any) -> Problem:
    """The equations of motion by the recursion."""
    return problem(articulated.rhs, coordinates.project, constants, workspace)


class Run:
    """An integrator with a problem and a workspace of its own, ready to be called."""

    def __init__(self, route: Route, settings: Settings, exact: Constants, nq: int, nu: int) -> None:
        """exact: the constants with every body eliminated explicitly, for Jacobians."""
        constants, self._workspace = route.tables()
        self._settings, self._nq, self._controlled = settings, nq, nq + nu
        motion = route.rhs, route.project, constants, self._workspace
        if settings.method in LINEARISING:
            moving = tangent.tangent_workspace(exact, nq, nu)
            self._problem: Any = stiff_problem(*motion, tangent.jacobian, retraction.move, exact, moving)
        else:
            self._problem = problem(*motion)

    def __call__(self, y: Real, times: Real, ends: Real, out: Real, counts: Index) -> tuple[int, float]:
        """Integrate y (nq+nu+1,) = [q, u, work]; see `flexmb.integrate.dop853.dop853`."""
        settings, limit = self._settings, self._settings.max_steps
        tolerances = settings.rtol, settings.atol
        if settings.method == "rk4":
            return rk4(self._problem, y, times, ends, settings.step, limit, out, counts)
        if settings.method == "generalised_alpha":
            return generalised_alpha(
                self._problem, y, times, ends, settings.step, settings.radius, self._nq, self._controlled,
                *tolerances, limit, out, counts,
            )  # fmt: skip
        adaptive = _ADAPTIVE[settings.method]
        return adaptive(self._problem, y, times, ends, *tolerances, self._controlled, limit, out, counts)

    @property
    def fault(self) -> int:
        """Where an evaluation failed."""
        return int(self._workspace.fault[0])
