"""The cheapest adequate model: up the ladders along the predictions, then down as far as the runs allow.

Every decision is a run of the whole scene; nothing is random and nothing is timed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexmb.advisor.confirm import Confirmation
from flexmb.advisor.ladder import Cost, Step
from flexmb.advisor.methods import Method
from flexmb.advisor.models import Model

START = 0.9
"""Of the tolerance: the first model that is run is the first predicted to be within that."""
HOPELESS = 20.0
"""Models predicted to miss the tolerance by this factor are not tried on the way down."""
FINALISTS = 3
"""Adequate models, by the cost of their fine runs, for which the best method is looked for."""

Choice = dict[str, Step]


@dataclass(frozen=True)
class Found:
    """A model and the method that suits it best; `exhausted`: the budget ended the walk down."""

    model: Model
    method: Method
    exhausted: bool


def search(ladders: dict[str, tuple[Step, ...]], confirmation: Confirmation, budget: float) -> Found | None:
    """The cheapest adequate model that the walk finds, or None where no choice of rungs is adequate.

    `ladders`: by body, its steps. `budget`: operations of all runs after which the walk down ends.
    """
    walk = _Walk(ladders, confirmation, budget)
    choice = walk.up()
    if choice is None:
        return None
    walk.down(choice)
    adequate = [model for model in confirmation.measured if confirmation.adequate(model)]
    finalists = sorted(adequate, key=confirmation.run_cost)[:FINALISTS]
    methods = {each: confirmation.cheapest_method(each) for each in finalists}
    model = min(finalists, key=lambda each: confirmation.bench.run(each, methods[each]).operations)
    return Found(model, methods[model], walk.exhausted)


def model_of(choice: Choice) -> Model:
    return tuple((name, step.rung) for name, step in choice.items())


class _Walk:
    def __init__(self, ladders: dict[str, tuple[Step, ...]], confirmation: Confirmation, budget: float) -> None:
        self.ladders, self.confirmation, self.budget = ladders, confirmation, budget
        self.cost: Cost = confirmation.cost
        self.exhausted = False

    def fits(self, choice: Choice) -> bool:
        return self.confirmation.adequate(model_of(choice))

    def up(self) -> Choice | None:
        """The first choice on the way up that is predicted to fit and does.

        Where predictions were wrong all the way up, those that were passed over have their turn, the finest last.
        """
        path = list(self.path())
        enough = START * self.confirmation.tolerance
        first = next((i for i, choice in enumerate(path) if _error(choice) <= enough), len(path) - 1)
        for choice in (*path[first:], *path[:first], *self.finest()):
            if self.fits(choice):
                return choice
        return None

    def path(self) -> Iterator[Choice]:
        """From the cheapest rungs upward: each step takes off most predicted error for the operations it adds."""
        choice = {name: min(steps, key=lambda s: (s.operations, s.fastest)) for name, steps in self.ladders.items()}
        while True:
            yield choice
            now = self.cost.of(choice.values())
            best, gain = None, 0.0
            for name, steps in self.ladders.items():
                for step in steps:
                    saved = choice[name].error - step.error
                    if saved <= 0.0:
                        continue
                    other = choice | {name: step}
                    worth = saved / max(self.cost.of(other.values()) - now, 1e-9 * now)
                    if worth > gain:
                        best, gain = other, worth
            if best is None:
                return
            choice = best

    def finest(self) -> Iterator[Choice]:
        """Every rung of every body that no step of the path tried, cheapest first, with all others at their dearest."""
        dearest = {name: max(steps, key=lambda s: (s.fastest, s.operations)) for name, steps in self.ladders.items()}
        for name, steps in self.ladders.items():
            for step in sorted(steps, key=lambda s: self.cost.of([s])):
                yield dearest | {name: step}

    def down(self, choice: Choice) -> None:
        """Body by body the cheapest rung with which the whole still fits, until nothing changes."""
        changed = True
        while changed and not self.exhausted:
            changed = False
            for name in self.ladders:
                better = self._cheaper(choice, name)
                if better is not None:
                    choice, changed = better, True

    def _cheaper(self, choice: Choice, name: str) -> Choice | None:
        """The choice with a cheaper rung of one body: of those that fit, the cheapest as run."""
        limit = HOPELESS * self.confirmation.tolerance
        expected = self.cost.of(choice.values())
        others = [choice | {name: step} for step in self.ladders[name] if step != choice[name] and step.error <= limit]
        best, least = None, self.confirmation.run_cost(model_of(choice))
        for other in sorted(others, key=lambda each: self.cost.of(each.values())):
            if self.cost.of(other.values()) > 1.5 * expected:
                break
            if self.confirmation.bench.spent > self.budget:
                self.exhausted = True
                break
            if self.fits(other) and self.confirmation.run_cost(model_of(other)) < least:
                best, least = other, self.confirmation.run_cost(model_of(other))
        return best


def _error(choice: Choice) -> float:
    """Predicted error of the whole: those of its bodies add up."""
    return float(np.sum([step.error for step in choice.values()]))
