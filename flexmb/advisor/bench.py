"""Runs of models by methods, each made only once: their signals and their cost in counted operations.

The cost is the number of operations of one evaluation of the accelerations, closures included (`flexmb.jit.counting`),
times the number of evaluations. It is counted and not timed, so that advice is the same on every machine. Times are
only displayed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.advisor.methods import RunMethod, simulated_within
from flexmb.advisor.models import Model, built, flexible_bodies
from flexmb.advisor.modes import mode_count
from flexmb.advisor.quantity import Quantity, Signals, measured
from flexmb.closure.closures import ClosureError
from flexmb.jain import cost
from flexmb.run.operations import of_evaluation, of_run
from flexmb.scene.schema import Scene
from flexmb.system.algorithm import Algorithm
from flexmb.system.algorithms import ALGORITHMS
from flexmb.system.compile import compile
from flexmb.system.system import System

SAMPLES = 401
MAX_STEPS = 400_000
EXACT = tuple(
    algorithm.name for algorithm in ALGORITHMS.values() if algorithm.route is not None and not algorithm.is_first_order
)
"""Algorithms that solve the equations of a model without further truncation."""
PREDICTED = {"articulated": cost.articulated, "composite": cost.composite}
"""Operations of an evaluation, by the number of modes of every body; all of `EXACT`."""
ALIKE = 1.2
"""Ratio of predicted operations up to which two algorithms are counted. Predictions exaggerate: composite bodies are
predicted to take 0.69, 1.14 and 1.98 times what the recursion takes for one beam of 4 modes, 4 and 8 pieces of 3 modes;
0.92, 1.19 and 1.61 times were counted."""
_OVERHEAD = 4e8
"""Time to compile a model and to evaluate the outputs of its run (0.2 s), expressed in operations."""


@dataclass(frozen=True)
class BenchRun:
    """One run: its `signals` up to its end; `message`: why it stopped early, or ""; counted `operations` and measured
    `seconds` of the integration alone. `cut`: it was stopped at the allowed number of operations;
    `reached`: the part of the output that it made; `accepted`: the part of its steps that were."""

    signals: Signals
    message: str
    evaluations: int
    operations: float
    seconds: float
    cut: bool = False
    reached: float = 0.0
    accepted: float = 1.0

    @property
    def finished(self) -> bool:
        return not self.message

    @property
    def tighter(self) -> float:
        """Operations that tighter tolerances or steps take at least: those of the whole run without its rejected
        steps, of which a tolerance that is too loose for the scene has more than the next ones."""
        return self.operations * self.accepted / self.reached if self.reached > 0.0 else np.inf


class Bench:
    """A scene, a horizon (s) and quantities; every model is compiled once, and every run is made once."""

    def __init__(self, scene: Scene, t_end: float, wanted: tuple[Quantity, ...], samples: int = SAMPLES) -> None:
        self.scene, self.t_end, self.wanted = scene, t_end, wanted
        self.times = np.linspace(0.0, t_end, samples)
        self.spent = 0.0  # operations of all runs, compilation and output included
        self._systems: dict[Model, System | str] = {}
        self._outcomes: dict[tuple[Model, RunMethod], BenchRun] = {}
        self._allowed: dict[tuple[Model, RunMethod], float] = {}
        self._operations: dict[tuple[Model, Algorithm], int] = {}

    def system(self, model: Model) -> System | str:
        """The compiled model, or the reason why it cannot be compiled."""
        if model not in self._systems:
            try:
                system = compile(built(self.scene, model))
                _ = system.initial_state  # a closed chain may have no initial state
                self._systems[model] = system
            except (ClosureError, ValueError, NotImplementedError) as error:
                self._systems[model] = str(error)
        return self._systems[model]

    def operations(self, model: Model, algorithm: Algorithm) -> int:
        """Operations of one evaluation of the accelerations at the initial state."""
        if (model, algorithm) not in self._operations:
            system = self.system(model)
            if isinstance(system, str):
                raise ValueError(system)
            self._operations[model, algorithm] = of_evaluation(system, algorithm)
        return self._operations[model, algorithm]

    def algorithm(self, model: Model) -> Algorithm:
        """The algorithm with fewer operations; both give the same accelerations. It is counted, which takes time, only
        where the polynomials of Jain & Rodriguez predict that both are much alike."""
        expected = {algorithm: self._predicted(model, algorithm) for algorithm in EXACT}
        first = min(EXACT, key=lambda algorithm: expected[algorithm])
        close = [algorithm for algorithm in EXACT if expected[algorithm] <= ALIKE * expected[first]]
        return min(close, key=lambda algorithm: self.operations(model, algorithm)) if len(close) > 1 else first

    def _predicted(self, model: Model, algorithm: Algorithm) -> int:
        system = self.system(model)
        if isinstance(system, str):
            raise ValueError(system)
        flexible = {body.name: mode_count(body) for body in flexible_bodies(system.scene)}
        return PREDICTED[algorithm]([flexible.get(body.name, 0) for body in system.scene.bodies]).total

    def run(self, model: Model, method: RunMethod, most: float = np.inf) -> BenchRun:
        """The run, made at the first call and stopped after about `most` operations."""
        outcome = self._outcomes.get((model, method))
        if outcome is None or (outcome.cut and most > self._allowed[model, method]):
            outcome = self._outcomes[model, method] = self._run(model, method, most)
            self._allowed[model, method] = most
            self.spent += outcome.operations + _OVERHEAD
        return outcome

    def _run(self, model: Model, method: RunMethod, most: float) -> BenchRun:
        system = self.system(model)
        if isinstance(system, str):
            return BenchRun({}, system, 0, 0.0, 0.0)
        each = self.operations(model, method.algorithm)
        try:
            done, cut = simulated_within(system, self.times, method, each, most, MAX_STEPS)
        except ClosureError as error:  # for example a mechanism that is locked
            return BenchRun({}, str(error), 0, 0.0, 0.0)
        if done is None:
            return BenchRun({}, "its equal steps would cost too much", 0, 0.0, 0.0, cut)
        taken = done.statistics
        return BenchRun(
            signals=measured(self.wanted, done) if len(done.t) else {},
            message="" if done.finished else done.message,
            evaluations=taken.evaluations,
            operations=of_run(method.integrator, each, system.nq + system.nu + 1, taken),
            seconds=taken.run_s,
            cut=cut,
            reached=len(done.t) / len(self.times),
            accepted=taken.accepted_steps / max(taken.accepted_steps + taken.rejected_steps, 1),
        )
