"""Compiled runs: the integrators applied to the equations of motion."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from flexmb.entry import articulated, tangent
from flexmb.integrate.control import COUNTS, SAMPLES, STOP
from flexmb.integrate.problem import Clock, Problem, problem, stiff_problem
from flexmb.integrate.settings import Settings
from flexmb.motion import coordinates, retraction
from flexmb.run.interruption import interruptible
from flexmb.run.switching import switch_times
from flexmb.system.algorithm import Route
from flexmb.system.tree_system import System
from flexmb.tables.arrays import Constants
from flexmb.tables.status import Status
from flexmb.typing import Index, Real


class Raw(NamedTuple):
    """The result of an integrator: states (T, nq+nu+1) at the samples reached, why and when it stopped, its cost."""

    states: Real
    status: Status
    fault: int
    t: float
    counts: list[int]
    compile_s: float
    run_s: float
    interrupted: bool


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


def integrate(system: System, route: Route, times: Real, settings: Settings) -> Raw:
    """Run once over no time at all, which compiles the kernels, and then over the whole time."""
    initial = system.initial_state
    ends = np.array([*switch_times(system.scene, times[-1]), times[-1]])

    def run(times: Real, ends: Real, call: Callable[..., tuple[Any, bool]]) -> Raw:
        y, out = np.concatenate([initial.q, initial.u, [0.0]]), np.empty((len(times), system.nq + system.nu + 1))
        counts = np.zeros(COUNTS, np.int64)
        begun = perf_counter()
        solve = Integration(route, settings, system.constants, system.nq, system.nu)
        start = perf_counter()
        (status, t), interrupted = call(solve, (y, Clock(times, ends), out, counts), counts[STOP : STOP + 1])
        end = perf_counter()
        return Raw(
            out[: counts[SAMPLES]], Status(status), solve.fault, t, counts.tolist(), end - begun, end - start,
            interrupted,
        )  # fmt: skip

    compiled = run(times[:1], ends[:0], lambda solve, arguments, _: (solve(*arguments), False))
    return run(times, ends, interruptible)._replace(compile_s=compiled.compile_s)
