"""Errors that were measured: candidates against the finest models that can be run, integration errors by refinement.

The references are run from coarse to fine until two successive ones agree within a quarter of the tolerance. What they
differ by is the uncertainty U of the finer; where differences of pieces and half pieces are seen to fall by a factor of
1/r > 2, what is left of the geometric series, r/(1 - r) of the last, r no less than 1/4. What ten times tighter
integration changes is part of U. A candidate is adequate if its distance to that one, plus U, plus what its integrator
adds, is within the tolerance: the triangle inequality, no luck.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flexmb.advisor.bench import Bench, BenchRun
from flexmb.advisor.ladder import STAGES, Cost, highest_frequency, model_cost, references
from flexmb.advisor.methods import FINEST, RunMethod, ladders
from flexmb.advisor.models import Model
from flexmb.advisor.quantity import Signals, error, scales
from flexmb.integrate.catalogue import INTEGRATORS

AGREED = 0.25
"""Of the tolerance: two references that differ by less are good enough."""
SECOND_ORDER = 0.25
"""Least ratio of successive differences that is believed: halved pieces converge by the second order at least."""
MOST = 0.5
"""Of the tolerance: with an uncertainty beyond that nothing can be told."""
FINE, TIGHTER, LOOSEST = 1e-3, 0.1, 1e-5
"""Relative tolerance that counts as fine, of the tolerance at first, then tightened by that; and at most."""
INTEGRATION, ROOM = 0.1, 0.05
"""Of the tolerance: the most that the references' own integration may be off; what a model leaves the integrator."""
FEW = 1000
"""Evaluations: where the fine run takes fewer, methods that linearise are not tried."""


class NoReference(ValueError):
    """Nothing that is known to be right can be run: the message says why."""


@dataclass(frozen=True)
class Reference:
    """The finest model that was run: its name, signals, scales and uncertainty U (part of the scale)."""

    name: str
    model: Model
    signals: Signals
    scale: dict[str, float]
    uncertainty: float
    history: tuple[str, ...]


class Confirmation:
    """Measures errors on a bench, relative to references that it finds first."""

    def __init__(self, bench: Bench, tolerance: float, hidden: float, cost: Cost, budget: float) -> None:
        """hidden: predicted error of what no reference can show; cost: predictions; budget: the most operations
        that one reference may be expected to cost."""
        self.bench, self.tolerance, self.cost = bench, tolerance, cost
        self.fine, self.drift = min(FINE * tolerance, LOOSEST), 0.0
        self.measured: dict[Model, float] = {}
        self.reference = self._reference(hidden, budget)

    def run(self, model: Model) -> BenchRun:
        """The model integrated so finely that only the model's own error is left."""
        return self.bench.run(model, self.finely(model))

    def finely(self, model: Model) -> RunMethod:
        """A method whose error does not count."""
        return RunMethod("dop853", max(FINEST, self.fine), self.bench.algorithm(model))

    def error(self, model: Model) -> float:
        """Error of a model, U included; infinite where it does not exist or does not finish."""
        if model not in self.measured:
            self.measured[model] = np.inf
            if not isinstance(self.bench.system(model), str) and self.run(model).finished:
                self.measured[model] = self._distance(self.run(model)) + self.reference.uncertainty
        return self.measured[model]

    def total_error(self, model: Model, method: RunMethod) -> float:
        """Error of a run of the model by that method, U included."""
        done = self.bench.run(model, method)
        return self._distance(done) + self.reference.uncertainty if done.finished else np.inf

    def run_cost(self, model: Model) -> float:
        """Operations of the model's fine run, infinite where there is none."""
        return np.inf if isinstance(self.bench.system(model), str) else self.run(model).operations

    def _distance(self, done: BenchRun) -> float:
        return error(done.signals, self.reference.signals, self.reference.scale)

    def adequate(self, model: Model) -> bool:
        """Whether the model leaves the integrator its share of the tolerance."""
        return self.error(model) <= (1.0 - ROOM) * self.tolerance

    def integration_error(self, model: Model, method: RunMethod) -> float:
        """How far a run is from the same model integrated finely."""
        done = self.bench.run(model, method)
        return error(done.signals, self.run(model).signals, self.reference.scale) if done.finished else np.inf

    def cheapest_method(self, model: Model) -> RunMethod:
        """The method with the fewest operations whose error fits beside the model's.

        In the ladder of every integrator, loose to tight, the first that fits and whose successor fits as well. A
        ladder ends where it costs more than what was found: tighter costs more still.
        """
        room = self.tolerance - self.error(model)
        scene, algorithm = self.bench.scene, self.bench.algorithm(model)
        highest, slow = highest_frequency(scene, model), self.cost.slow / (STAGES * self.bench.t_end)
        best, least, steady = self.finely(model), self.run(model).operations, self.run(model).evaluations < FEW
        for ladder in ladders(highest, slow, algorithm, not scene.closures):
            if steady and INTEGRATORS[ladder[0].integrator].linearises:
                continue
            before: RunMethod | None = None
            for method in ladder:
                if method.adaptive and method.value <= self.finely(model).value:
                    break
                done = self.bench.run(model, method, least if before is None else np.inf)
                if done.cut:
                    break
                fits = self.integration_error(model, method) <= room
                if fits and before is not None:
                    best, least = before, self.bench.run(model, before).operations
                    break
                if done.finished and done.operations >= least:
                    break
                before = method if fits else None
        return best

    def _reference(self, hidden: float, budget: float) -> Reference:
        history: list[str] = []
        steps: list[float] = []
        last: Reference | None = None
        known = references(self.bench.scene)
        for name, model in known:
            if last is not None and model_cost(self.bench.scene, model, self.cost) > budget:
                history.append(f"{name}: would cost too much")
                continue
            system = self.bench.system(model)
            done = None if isinstance(system, str) else self.run(model)
            if done is None or not done.finished:
                history.append(f"{name}: {system if done is None else done.message}")
                continue
            if last is None:
                self._refine(model)
                done = self.run(model)
                scale = scales(self.bench.wanted, done.signals)
                last = Reference(name, model, done.signals, scale, np.inf, ())
                continue
            scale = scales(self.bench.wanted, done.signals)
            apart = error(done.signals, last.signals, scale)
            history.append(f"{last.name} and {name} differ by {apart:.2g}")
            falls = max(apart / steps[-1], SECOND_ORDER) if steps and steps[-1] > 0.0 else 1.0
            steps += [apart] if last.name.endswith("pieces") else []
            left = apart * falls / (1.0 - falls) if falls < 0.5 else apart
            last = Reference(name, model, done.signals, scale, left + hidden + self.drift, tuple(history))
            if last.uncertainty <= AGREED * self.tolerance:
                return last
        if last is None:
            models = "the finest models of this scene do not run" if len(known) > 1 else "this does not run"
            raise NoReference(f"{models} to the end: {'; '.join(history)}")
        if len(known) == 1:  # rigid bodies, or raw ones that have the modes they have
            last = replace(last, uncertainty=hidden + self.drift)
        if last.uncertainty > MOST * self.tolerance:
            alone = [f"{last.name} alone can be run"] if np.isinf(last.uncertainty) else []
            raise NoReference(self._unresolved(hidden, alone + history))
        return last

    def _refine(self, model: Model) -> None:
        """Tighten what counts as fine until ten times tighter changes the reference by less than its share: `drift`."""
        while self.fine > FINEST:
            coarse, method = self.run(model), self.finely(model)
            tighter = self.bench.run(model, replace(method, value=max(FINEST, TIGHTER * self.fine)))
            if not tighter.finished:
                return
            scale = scales(self.bench.wanted, tighter.signals)
            self.drift = error(coarse.signals, tighter.signals, scale)
            if self.drift <= INTEGRATION * self.tolerance:
                return
            self.fine *= TIGHTER

    def _unresolved(self, hidden: float, history: list[str]) -> str:
        text = "; ".join(history)
        if hidden > AGREED * self.tolerance:
            text += f"; what none of its models shows (second-order deflection) is estimated as {hidden:.2g}"
        return f"the finest models of this scene are not known to {self.tolerance:g} of the quantity: {text}"
