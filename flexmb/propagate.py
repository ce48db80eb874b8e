"""Compiled runs: the integrators applied to the equations of motion. Here the two rooms meet; nothing else happens."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from flexmb import coordinates, dynamics, retraction, tangent
from flexmb.arrays import Constants, Index, Real
from flexmb.integrate.dop853 import dop853
from flexmb.integrate.exponential import exponential
from flexmb.integrate.generalised_alpha import generalised_alpha
from flexmb.integrate.problem import Problem, problem, stiff_problem
from flexmb.integrate.radau5 import radau5
from flexmb.integrate.rk4 import rk4
from flexmb.methods import LINEARISING, Settings

_ADAPTIVE = {"dop853": dop853, "radau5": radau5, "exponential": exponential}


class Route(NamedTuple):
    """An algorithm as runs see it: a maker of constants and workspace, kernels of the motion and of its manifold."""

    tables: Callable[[], tuple[Any, Any]]
    rhs: Any = dynamics.rhs
    project: Any = coordinates.project


def recursion(constants: Constants, workspace: Any) -> Problem:
    """The equations of motion by the recursion."""
    return problem(dynamics.rhs, coordinates.project, constants, workspace)


def run(
    route: Route, settings: Settings, exact: Constants, nq: int, y: Real, times: Real, ends: Real, out: Real,
    counts: Index,
) -> tuple[int, float, int]:  # fmt: skip
    """Integrate y (nq+nu+1,) = [q, u, work]; all else is as in `flexmb.integrate.dop853.dop853`.

    exact: the constants with every body eliminated explicitly, for Jacobians. Returns the status code, the time of the
    last good state, and where an evaluation failed.
    """
    constants, workspace = route.tables()
    motion, controlled, limit = (route.rhs, route.project, constants, workspace), len(y) - 1, settings.max_steps
    if settings.method in LINEARISING:
        moving = tangent.tangent_workspace(exact, nq, controlled - nq)
        equations: Any = stiff_problem(*motion, tangent.jacobian, retraction.move, exact, moving)
    else:
        equations = problem(*motion)
    tolerances = settings.rtol, settings.atol
    if settings.method == "rk4":
        status, t = rk4(equations, y, times, ends, settings.step, limit, out, counts)
    elif settings.method == "generalised_alpha":
        status, t = generalised_alpha(
            equations, y, times, ends, settings.step, settings.radius, nq, controlled, *tolerances, limit, out, counts
        )
    else:
        adaptive = _ADAPTIVE[settings.method]
        status, t = adaptive(equations, y, times, ends, *tolerances, controlled, limit, out, counts)
    return status, t, int(workspace.fault[0])
