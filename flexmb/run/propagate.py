"""Compiled runs: the integrators applied to the equations of motion."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from flexmb.entry import articulated, tangent
from flexmb.integrate.control import COUNTS, SAMPLES, STOP
from flexmb.integrate.integrator import Integrator
from flexmb.integrate.problem import Accuracy, Clock, Problem, problem, stiff_problem
from flexmb.integrate.settings import Settings
from flexmb.jit.direct import undispatched
from flexmb.motion import coordinates, retraction
from flexmb.run.interruption import interruptible
from flexmb.run.observing import batch
from flexmb.run.switching import timing_of
from flexmb.system import algorithms
from flexmb.system.algorithm import Algorithm, DynamicsAlgorithm, Route
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

    def __init__(self, system: System, algorithm: DynamicsAlgorithm, route: Route, integrator: Integrator) -> None:
        constants, self._workspace = route.tables()
        self._integrator = integrator
        motion = route.rhs, route.project, constants, self._workspace
        if integrator.linearises:
            exact = system.constants  # with every body eliminated explicitly, for Jacobians
            moving = tangent.tangent_workspace(exact, system.nq, system.nu)
            self._problem: Any = stiff_problem(*motion, tangent.jacobian, retraction.move, exact, moving)
        else:
            self._problem = problem(*motion, route.leaping)
        batched = algorithm.observing is not None and not system.scene.closures
        self.batch = batch(system, route.rhs, algorithm.observing, constants, self._workspace) if batched else None
        """Observes many samples at once."""
        self._enter: Any = None

    def __call__(self, y: Real, clock: Clock, accuracy: Accuracy, out: Real, counts: Index) -> tuple[int, float]:
        """Integrate y (nq+nu+1,) = [q, u, work]; see `Integrator`. All arrays in C order."""
        self.compile(y, clock, accuracy, out, counts)
        return self._enter(self._problem, y, clock, accuracy, out, counts)

    def compile(self, y: Real, clock: Clock, accuracy: Accuracy, out: Real, counts: Index) -> None:
        """For a call with these, unless that is done."""
        if self._enter is None:
            self._enter = undispatched(self._integrator.run, self._problem, y, clock, accuracy, out, counts)

    @property
    def fault(self) -> int:
        """Where an evaluation failed."""
        return int(self._workspace.fault[0])


@contextmanager
def integration(
    system: System, algorithm: Algorithm, stabilise: float, integrator: Integrator
) -> Iterator[Integration]:
    """One that nobody else uses meanwhile; kept for the next run, but of closed chains, which remember their branch.

    ValueError and others for what does not go together: see `System.route`.
    """
    route = system.route(algorithm, stabilise)
    spare: list[Integration] = system.kept.setdefault((Integration, algorithm, integrator.name), [])
    try:
        found = spare.pop()
    except IndexError:
        found = Integration(system, algorithms.chosen(algorithm), route, integrator)
    yield found
    if not system.scene.closures:
        spare.append(found)


def integrate(system: System, solve: Integration, times: Real, settings: Settings) -> Raw:
    """Run over the whole time, after what has to be compiled for it."""
    initial, accuracy = system.initial_state, settings.accuracy(system.nq, system.nu)
    ends = np.array([*timing_of(system).before(times[-1]), times[-1]])
    out, counts = np.empty((len(times), len(initial.y))), np.zeros(COUNTS, np.int64)
    given = initial.y, Clock(times, ends), accuracy, out, counts
    start = perf_counter()
    solve.compile(*given)
    begun = perf_counter()
    (status, t), interrupted = interruptible(solve, given, counts[STOP : STOP + 1])
    end = perf_counter()
    return Raw(
        out[: counts[SAMPLES]], Status(status), solve.fault, t, counts.tolist(), begun - start, end - begun, interrupted
    )
