"""One scene compiled for Basilisk: evaluate at t = 0, or integrate with SciPy's DOP853."""

from __future__ import annotations

import time

import numpy as np

from crosscheck.engines.basilisk.craft import craft_of
from crosscheck.engines.basilisk.dynamics import CraftDynamics
from crosscheck.engines.basilisk.observer import BasiliskObserver
from crosscheck.engines.contract import Effort, Run, Snapshot, Status, Trajectory
from crosscheck.engines.functions_of_time import scene_functions
from crosscheck.engines.scipy_loop import integrate
from crosscheck.engines.trajectories import stack
from flexmb.scene.schema import Scene


class BasiliskModel:
    def __init__(self, scene: Scene) -> None:
        self._dynamics = CraftDynamics(craft_of(scene), scene)
        self._observer = BasiliskObserver(self._dynamics, scene)
        self._functions = scene_functions(scene)

    def warm_up(self) -> None:
        """Nothing is compiled; touch the code once so that first-call costs are not timed."""
        self._dynamics.rate(0.0, self._dynamics.initial())

    def evaluate(self) -> Snapshot:
        return self._observer.observe(0.0, self._dynamics.state(self._dynamics.initial()))

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        start = time.perf_counter()
        with np.errstate(over="ignore", invalid="ignore"):  # divergence is a status
            y = self._dynamics.initial()
            states, evaluations, message = integrate(self._dynamics.rate, y, self._functions, run.times, effort)
        wall = time.perf_counter() - start
        reached = run.times[: len(states)]
        samples = [self._observer.observe(t, self._dynamics.state(y)) for t, y in zip(reached, states, strict=True)]
        status: Status = "finished" if len(states) == len(run.times) else "diverged"
        work = np.array([y[-1] for y in states])
        return stack(reached, samples, status=status, message=message, wall_s=wall, evaluations=evaluations, work=work)
