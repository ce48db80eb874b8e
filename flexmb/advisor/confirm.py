"""Measured errors: of candidates against the finest models that can be run, of integrators by refinement.

The references are run from coarse to fine until two successive ones agree within a quarter of the tolerance. Their
difference is the uncertainty U of the finer one. If halving the pieces reduces the difference by a ratio r < 1/2, U is
instead the remainder of the geometric series, r/(1 - r) times the last difference, with r at least 1/4. Where even
r^2 would leave too much at the last reference, no further one is run, and there is no advice. The change under ten
times tighter integration is added to U. A candidate is adequate if its distance to the finest reference, plus U, plus
the error of its integrator, is within the tolerance; by the triangle inequality this bounds its error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from flexmb.advisor.bench import Bench, BenchRun
from flexmb.advisor.ladder import STAGES, Cost, highest_frequency, model_cost
from flexmb.advisor.methods import FINEST, TOLERANCES, RunMethod, ladders
from flexmb.advisor.models import Model, flexible_bodies, undamped
from flexmb.advisor.quantity import Signals, error, scales
from flexmb.integrate.catalogue import INTEGRATORS

AGREED = 0.25
"""References are refined until two differ by less than this fraction of the tolerance."""
SECOND_ORDER = 0.25
"""Lower limit of the ratio r of successive differences, that of convergence of order 2 under halving."""
MOST = 0.5
"""With an uncertainty above this fraction of the tolerance no candidate can be judged."""
FINE, TIGHTER, LOOSEST = 1e-2, 0.1, 1e-5
"""Relative tolerance of a fine run: FINE times the tolerance, at most LOOSEST, tightened by the factor TIGHTER."""
EASED = 10.0
"""Fine runs of Radau 5 have so many times this tolerance: it bounds an error estimate of order 3 for a method of order
5. What ten times tighter runs change is measured for it as for DOP853."""
INTEGRATION, ROOM = 0.1, 0.05
"""Fractions of the tolerance: largest integration error of a reference; part that is reserved for the integrator."""
_FEW_EVALUATIONS = 1000
"""Methods that linearise are not tried if the fine run takes fewer evaluations than this."""


EXPLICIT, IMPLICIT = "dop853", "radau5"
CHEAP = 1e9
"""Explicit runs that are predicted to take fewer operations are not compared with implicit ones."""
OVERCOUNTED = 4.0
"""Runs of Radau 5 may have so many times the budget, because their Jacobians are counted column by column, as they are
not computed."""
GLIMPSE, SLOW = 0.125, 4.0
"""Radau 5 first gets the fraction GLIMPSE of the operations that it may take. If it comes SLOW times less far than this
part of the horizon, it is not run on."""
DEAR = 3e9
"""With an uncertainty of at most MOST, references that are predicted to take more operations are left out at first."""
DEARER = 4.0
"""The run that confirms a method by a tighter tolerance or step may take so many times what the best one takes."""
References = tuple[tuple[str, Model], ...]


class NoReference(ValueError):
    """There is no reference with a small uncertainty; the message says why.

    `beyond`: predicted operations of the next finer one that would cost too much, infinite if there is none; `reached`:
    uncertainty of the finest that ran, infinite if it has none.
    """

    def __init__(self, message: str, beyond: float = np.inf, reached: float = np.inf) -> None:
        super().__init__(message)
        self.beyond, self.reached = beyond, reached


@dataclass(frozen=True)
class Reference:
    """The finest model that was run: its name, signals, scales and uncertainty U (a fraction of the scale)."""

    name: str
    model: Model
    signals: Signals
    scale: dict[str, float]
    uncertainty: float
    history: tuple[str, ...]


class Confirmation:
    """Measures errors of models relative to references, which it determines first."""

    def __init__(
        self, bench: Bench, tolerance: float, hidden: float, cost: Cost, budget: float, known: References
    ) -> None:
        """`hidden`: predicted error that all references have in common; `cost`: predictions; `budget`: largest
        predicted number of operations of one reference; `known`: the references, from coarse to fine.
        """
        self.bench, self.tolerance, self.cost, self.budget = bench, tolerance, cost, budget
        self._hidden, self._known = hidden, known
        self._integrators: dict[Model, str] = {}
        flexible = flexible_bodies(bench.scene)
        self._damped = not bench.scene.constraints and not all(map(undamped, flexible))
        first = min(FINE * tolerance, LOOSEST)
        self._fine, self._drifts = {EXPLICIT: first, IMPLICIT: EASED * first}, dict[str, float]()
        self.measured: dict[Model, float] = {}
        self.references: list[Model] = []  # those that ran, from coarse to fine
        self.may_refine = False
        self.beyond = np.inf  # predicted operations of the cheapest finer reference that would cost too much
        self.reference = self._reference(DEAR)

    @property
    def drift(self) -> float:
        """What ten times tighter integration changes in a reference."""
        return max(self._drifts.values(), default=0.0)

    def refine(self) -> bool:
        """Determine finer references if some were left out because they are dear; whether there are any. Errors are
        measured anew."""
        before = self.reference
        if self.may_refine:
            self.reference = self._reference(np.inf)
            self.measured = {}
        return self.reference.model != before.model

    def run(self, model: Model, most: float = np.inf) -> BenchRun:
        """The run of the model, of at most about `most` operations, with an integration error that is negligible beside
        the error of the model."""
        return self.bench.run(model, self.finely(model, most), most)

    def finely(self, model: Model, most: float = np.inf) -> RunMethod:
        """The method of fine runs, found by runs of at most `most` operations."""
        return self._finely(model, self._integrator(model, most))

    def _finely(self, model: Model, integrator: str) -> RunMethod:
        return self._method(model, integrator, max(FINEST, self._fine[integrator]))

    def _method(self, model: Model, integrator: str, rtol: float) -> RunMethod:
        """Only the recursion has the derivatives that Radau 5 needs."""
        return RunMethod(integrator, rtol, "articulated" if integrator == IMPLICIT else self.bench.algorithm(model))

    def _integrator(self, model: Model, most: float = np.inf) -> str:
        """DOP853, or Radau 5 for strains and trees with damping if it takes fewer operations than the highest frequency
        demands of DOP853, or if these exceed the budget and Radau 5 is within it."""
        if model in self._integrators:
            return self._integrators[model]
        chosen, enough = EXPLICIT, 0.0
        expected = self._expected(model)
        if self._may_be_stiff(model) and expected > CHEAP and not isinstance(self.bench.system(model), str):
            enough = expected if expected <= self.budget else OVERCOUNTED * self.budget
            done = self.bench.run(model, self._finely(model, IMPLICIT), min(most, GLIMPSE * enough))
            if done.cut and done.reached > GLIMPSE / SLOW:
                done = self.bench.run(model, self._finely(model, IMPLICIT), min(most, enough))
            chosen = IMPLICIT if done.finished else EXPLICIT
        if chosen == IMPLICIT or enough <= most:  # otherwise a longer run may still decide for Radau 5
            self._integrators[model] = chosen
        return chosen

    def _may_be_stiff(self, model: Model) -> bool:
        """Whether Radau 5 may make a run of the model that would cost DOP853 too much."""
        return self._damped or any(rung.kind == "strains" for _, rung in model)

    def _too_costly(self, model: Model) -> bool:
        return self._integrator(model) == EXPLICIT and self._expected(model) > self.budget

    def _expected(self, model: Model) -> float:
        """Predicted operations of its run by DOP853."""
        return model_cost(self.bench.scene, model, self.cost)

    def error(self, model: Model, most: float = np.inf) -> float:
        """Error of a model, U included; infinite if it cannot be compiled or does not finish. Nothing is known of it,
        and it is infinite as well, if its run takes more than about `most` operations."""
        if model not in self.measured:
            error = np.inf
            if not isinstance(self.bench.system(model), str):
                done = self.run(model, most)
                if done.cut:
                    return np.inf
                error = self._distance(done) + self.reference.uncertainty if done.finished else np.inf
            self.measured[model] = error
        return self.measured[model]

    def total_error(self, model: Model, method: RunMethod) -> float:
        """Error of a run of the model by that method, U included."""
        done = self.bench.run(model, method)
        return self._distance(done) + self.reference.uncertainty if done.finished else np.inf

    def run_cost(self, model: Model) -> float:
        """Operations of the model's fine run, infinite if it cannot be compiled."""
        return np.inf if isinstance(self.bench.system(model), str) else self.run(model).operations

    def _distance(self, done: BenchRun) -> float:
        return error(done.signals, self.reference.signals, self.reference.scale)

    def adequate(self, model: Model, most: float = np.inf) -> bool:
        """Whether the error of the model leaves the fraction ROOM of the tolerance to the integrator; not if its run
        takes more than about `most` operations."""
        return self.error(model, most) <= (1.0 - ROOM) * self.tolerance

    def integration_error(self, model: Model, method: RunMethod) -> float:
        """Distance of a run from the fine run of the same model."""
        done = self.bench.run(model, method)
        return error(done.signals, self.run(model).signals, self.reference.scale) if done.finished else np.inf

    def cheapest_method(self, model: Model, most: float = np.inf) -> RunMethod:
        """The method with the fewest operations whose error plus that of the model is within the tolerance; if it takes
        `most` or more, any that does.

        In the ladder of every integrator, from loose to tight, it takes the first method that is accurate enough and
        whose successor is, too; a single small error may be accidental. A ladder ends at a method after which tighter
        ones cost more than the best one found. The integrator of the fine run comes first, because it is likely to be
        cheap, and then ends the runs of the others early.
        """
        room, fine = self.tolerance - self.error(model), self.finely(model)
        scene, algorithm = self.bench.scene, self.bench.algorithm(model)
        highest, slow = highest_frequency(scene, model), self.cost.slow / (STAGES * self.bench.t_end)
        best, least = fine, min(most, self.run(model).operations)
        short = self.run(model).evaluations < _FEW_EVALUATIONS
        chosen = ladders(highest, slow, algorithm, not scene.constraints, float(self.bench.times[1]))
        if scene.constraints and best.integrator == IMPLICIT:
            chosen = (tuple(self._method(model, IMPLICIT, rtol) for rtol in TOLERANCES), *chosen)
        for ladder in sorted(chosen, key=lambda ladder: ladder[0].integrator != best.integrator):
            if short and INTEGRATORS[ladder[0].integrator].linearises:
                continue
            before: RunMethod | None = None
            for method in ladder:
                if method.adaptive and method.value <= fine.value:
                    if before is not None and method.integrator == fine.integrator:  # the fine run is its successor
                        best, least = before, self.bench.run(model, before).operations
                    break
                done = self.bench.run(model, method, least if before is None else DEARER * least)
                fits = not done.cut and self.integration_error(model, method) <= room
                if fits and before is not None:
                    best, least = before, self.bench.run(model, before).operations
                    break
                if (done.cut or done.finished) and done.tighter >= least:
                    break
                before = method if fits and done.operations < least else None
        return best

    def _reference(self, dear: float) -> Reference:
        """The first reference that agrees with the one before; or one that is known well enough, if the next one is
        predicted to take more than `dear` operations."""
        hidden, known = self._hidden, self._known
        history: list[str] = []
        steps: list[float] = []
        last: Reference | None = None
        self.references, self.may_refine, self.beyond = [], False, np.inf
        for n, (name, model) in enumerate(known):
            most = MOST * self.tolerance
            if last is not None and last.uncertainty > most and len(steps) > 1:
                costs = [0.0 if self._may_be_stiff(each) else self._expected(each) for _, each in known[n:]]
                affordable = sum(cost <= self.budget for cost in costs)
                if affordable and hopeless(steps, affordable, most):
                    dearer = [cost for i, cost in enumerate(costs) if not hopeless(steps, i + 1, most)]
                    self.beyond = min(dearer, default=np.inf)
                    history.append("these differences fall too slowly for finer models to be run")
                    break
            if last is not None and last.uncertainty <= most and self._expected(model) > dear:
                self.may_refine = True
                break
            if last is not None and self._too_costly(model):
                self.beyond = min(self.beyond, self._expected(model))
                history.append(f"{name}: would cost too much")
                continue
            system = self.bench.system(model)
            done = None if isinstance(system, str) else self.run(model)
            if done is None or not done.finished:
                history.append(f"{name}: {system if done is None else done.message}")
                continue
            self.references.append(model)
            self._refine(model)
            done = self.run(model)
            if last is None:
                scale = scales(self.bench.wanted, done.signals)
                last = Reference(name, model, done.signals, scale, np.inf, ())
                continue
            scale = scales(self.bench.wanted, done.signals)
            apart = error(done.signals, last.signals, scale)
            history.append(f"{last.name} and {name} differ by {apart:.2g}")
            left = _remainder(apart, steps[-1] if steps else 0.0)
            steps += [apart] if " pieces" in last.name else []
            last = Reference(name, model, done.signals, scale, left + hidden + self.drift, tuple(history))
            if last.uncertainty <= AGREED * self.tolerance:
                return last
        if last is None:
            models = "the finest models of this scene do not run" if len(known) > 1 else "this does not run"
            raise NoReference(f"{models} to the end: {'; '.join(history)}", self.beyond)
        if len(known) == 1:  # all bodies are rigid or raw, and have no finer model
            last = replace(last, uncertainty=hidden + self.drift)
        if last.uncertainty > MOST * self.tolerance:
            alone = [f"{last.name} alone can be run"] if np.isinf(last.uncertainty) else []
            raise NoReference(self._unresolved(hidden, alone + history), self.beyond, last.uncertainty)
        return last

    def _refine(self, model: Model) -> None:
        """Tighten fine runs of its integrator, of the first reference that has it, until ten times tighter ones change
        the reference by less than INTEGRATION."""
        integrator = self._integrator(model)
        if integrator in self._drifts:
            return
        while self._fine[integrator] > FINEST:
            coarse, method = self.run(model), self.finely(model)
            tighter = self.bench.run(model, replace(method, value=max(FINEST, TIGHTER * self._fine[integrator])))
            if not tighter.finished:
                return
            scale = scales(self.bench.wanted, tighter.signals)
            self._drifts[integrator] = error(coarse.signals, tighter.signals, scale)
            if self._drifts[integrator] <= INTEGRATION * self.tolerance:
                return
            self._fine[integrator] *= TIGHTER

    def _unresolved(self, hidden: float, history: list[str]) -> str:
        text = "; ".join(history)
        if hidden > AGREED * self.tolerance:
            text += f"; the second-order deflection, which none of its models has, is estimated as {hidden:.2g}"
        return f"the finest models of this scene are not known to {self.tolerance:g} of the quantity: {text}"


def hopeless(steps: Sequence[float], more: int, most: float) -> bool:
    """Whether the last of so many more references would have an uncertainty above `most`, even if its order were twice
    that of the last differences, `steps`. It takes many times the operations of all before."""
    if len(steps) < 2 or not steps[-2] > 0.0:
        return False
    ratio = min(steps[-1] / steps[-2], 1.0) ** 2
    before = steps[-1] * ratio ** (more - 1)
    return _remainder(before * ratio, before) > most


def _remainder(apart: float, before: float) -> float:
    """What a reference leaves that differs so much from the one before it, and that by `before` (0: unknown)."""
    falls = max(apart / before, SECOND_ORDER) if before > 0.0 else 1.0
    return apart * falls / (1.0 - falls) if falls < 0.5 else apart
