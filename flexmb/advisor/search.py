"""Search for the cheapest adequate model: up the ladder until one is adequate, then down to cheaper adequate ones.

The cost of a run depends on the highest frequency in it, and then on the operations of an evaluation. The way up
therefore raises a limit of the frequency step by step, and gives every body the best rung below it. The way down first
tries models that are predicted to be much cheaper, in which several bodies may change, and then changes one body at a
time.

Every decision is based on a run of the whole scene; nothing is random and nothing is timed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product
from math import prod

import numpy as np

from flexmb.advisor.confirm import Confirmation
from flexmb.advisor.ladder import Step, highest_frequency
from flexmb.advisor.methods import RunMethod
from flexmb.advisor.models import EXACT, LEVELS, BodyModel, Model

HOPELESS = 20.0
"""Models predicted to miss the tolerance by this factor are tried last on the way up, and never on the way down."""
MISSED = 2.0
"""A rung that missed the tolerance by this factor is not tried again when other bodies have become coarser."""
SLACK, WORTH = 1.5, 0.9
"""On the way down a rung is tried if its predicted cost is below this multiple of that of the adequate one: the first
for a scene with one flexible body, because predictions are inaccurate; the second for several, to limit the trials.
"""
LEAP, LEAPS, MANY = 0.75, 15, 20_000
"""LEAP: choices with at most this fraction of the predicted cost are tried first; LEAPS: at most so many of them; MANY:
with more combinations than this, only pairs of bodies change.
"""
SPARE = 2.0
"""Runs of models that are to be cheaper than an adequate one end at so many times the operations of its run."""
FINALISTS = 3
"""Number of adequate models, the cheapest by their fine runs, for which the best method is determined."""

_EVERY = (*LEVELS, EXACT)

Choice = dict[str, Step]


@dataclass(frozen=True)
class Found:
    """A model and its cheapest method; `exhausted`: whether the budget ended the search."""

    model: Model
    method: RunMethod
    exhausted: bool


def search(ladders: dict[str, tuple[Step, ...]], confirmation: Confirmation, budget: float) -> Found | None:
    """The cheapest adequate model that the search finds, or None if no choice of rungs is adequate.

    `ladders`: the steps of each body. `budget`: the search for cheaper models ends when its runs, compilation and
    output included, have taken this many operations.
    """
    walk = _Walk(ladders, confirmation, budget)
    choice = walk.up()
    if choice is None:
        return None
    walk.down(choice)
    adequate = [model for model in confirmation.measured if confirmation.adequate(model)]
    finalists = sorted(adequate, key=confirmation.run_cost)[:FINALISTS]
    best, least = finalists[0], np.inf
    methods: dict[Model, RunMethod] = {}
    for finalist in finalists:
        methods[finalist] = confirmation.cheapest_method(finalist, least)
        operations = confirmation.bench.run(finalist, methods[finalist]).operations
        if operations < least:
            best, least = finalist, operations
    return Found(best, methods[best], walk.exhausted)


def model_of(choice: Choice) -> Model:
    return tuple((name, step.rung) for name, step in choice.items())


class _Walk:
    def __init__(self, ladders: dict[str, tuple[Step, ...]], confirmation: Confirmation, budget: float) -> None:
        self.confirmation = confirmation
        known = highest_frequency(confirmation.bench.scene, confirmation.reference.model)
        self.ladders = {  # models with higher frequencies than the reference cost more than it
            name: tuple(step for step in steps if step.fastest <= known) for name, steps in ladders.items()
        }
        self.most = confirmation.bench.spent + budget
        self.missed: dict[str, set[BodyModel]] = {name: set() for name in ladders}
        self.hopeless = HOPELESS * confirmation.tolerance
        self.predicted = any(step.error > 0.0 for steps in self.ladders.values() for step in steps)

    def fits(self, choice: Choice, most: float = np.inf) -> bool:
        return self.confirmation.adequate(model_of(choice), most)

    @property
    def exhausted(self) -> bool:
        return self.confirmation.bench.spent > self.most

    def up(self) -> Choice | None:
        """The first choice on the way up that is adequate.

        If none is, every rung of every body is tried. Of all these the ones with a large predicted error come last.
        Without predictions, the references come first, which have run, the cheapest at the head.
        """
        if not self.predicted:
            known = [choice for model in self.confirmation.references if (choice := self.choice_of(model)) is not None]
            for choice in sorted(
                known, key=lambda choice_of_models: self.confirmation.run_cost(model_of(choice_of_models))
            ):
                if self.fits(choice):
                    return choice
        every = (*self.way(), *self.finest())
        hopeful = [choice for choice in every if _error(choice) <= self.hopeless]
        others = [choice for choice in every if _error(choice) > self.hopeless]
        return next(filter(self.fits, (*hopeful, *others)), None)

    def choice_of(self, model: Model) -> Choice | None:
        """The steps of a model, or None if one of its rungs is not among them."""
        steps = {name: {step.rung: step for step in self.ladders[name]}.get(rung) for name, rung in model}
        steps_of = {name: step for name, step in steps.items() if step is not None}
        return steps_of if len(steps_of) == len(steps) else None

    def way(self) -> Iterator[Choice]:
        """For each highest frequency, lowest first, the rungs of least predicted error that do not exceed it."""
        before: Choice | None = None
        for highest in sorted({0.0} | {step.fastest for steps in self.ladders.values() for step in steps}):
            choice = self.finest_below(highest, _EVERY)
            if choice != before:
                yield choice
            before = choice

    def finest_below(self, highest: float, levels: tuple[str, ...]) -> Choice:
        """For every body the rung of one of the levels with the least predicted error and no higher frequency; among
        equal ones, for example without predictions, the most expensive.
        """
        return {
            name: min(
                (s for s in steps if s.fastest <= highest and s.rung.level in ("rigid", *levels)),
                key=lambda s: (s.error, -s.operations),
            )
            for name, steps in self.ladders.items()
        }

    def finest(self) -> Iterator[Choice]:
        """Every rung of every body, cheapest first, while all other bodies have their most expensive one."""
        dearest = {name: max(steps, key=lambda s: (s.fastest, s.operations)) for name, steps in self.ladders.items()}
        for name, steps in self.ladders.items():
            for step in sorted(steps, key=lambda s: self.expected({name: s})):
                yield dearest | {name: step}

    def down(self, choice: Choice) -> None:
        """Try cheaper choices until none is adequate or the budget is spent: simpler levels for all bodies, the same
        rung for all, much cheaper combinations, body by body.
        """
        highest = max((step.fastest for step in choice.values()), default=0.0)
        simpler = (self.finest_below(highest, _EVERY[:n]) for n in range(1, len(_EVERY)))
        if not self.predicted:  # nothing says that they are adequate, and they may cost more
            most = self.confirmation.run_cost(model_of(choice))
            simpler = (other for other in simpler if self.expected(other) <= most)
        most = SPARE * self.confirmation.run_cost(model_of(choice))
        choice = next((other for other in simpler if self.fits(other, most)), choice)
        choice = self.first_cheaper(choice, sorted(self.alike(choice), key=self.expected)) or choice
        while True:
            while (other := self.leap(choice)) is not None:
                choice = other
            settled = self.settled(choice)
            if settled == choice:
                return
            choice = settled

    def settled(self, choice: Choice) -> Choice:
        """Give one body after the other the cheapest rung with which the scene is adequate, until nothing changes."""
        changed = True
        while changed:
            changed = False
            for name in self.ladders:
                better = self.cheaper(choice, name)
                if better is not None:
                    choice, changed = better, True
        return choice

    def cheaper(self, choice: Choice, name: str) -> Choice | None:
        """The choice with a cheaper rung for one body: of the adequate ones the one with the cheapest run."""
        slack = SLACK if len(self.ladders) == 1 else WORTH
        enough, best, least = self.expected(choice), None, self.confirmation.run_cost(model_of(choice))
        others = [choice | {name: step} for step in self.steps(name)]
        for other in sorted(others, key=self.expected):
            if self.exhausted or self.expected(other) > slack * enough:
                break
            if self.fits(other, SPARE * least) and self.confirmation.run_cost(model_of(other)) < least:
                best, least = other, self.confirmation.run_cost(model_of(other))
                enough = self.expected(other)
            if self.confirmation.error(model_of(other), SPARE * least) > MISSED * self.confirmation.tolerance:
                self.missed[name].add(other[name].rung)
        return best

    def leap(self, choice: Choice) -> Choice | None:
        """A much cheaper adequate choice, with other rungs for several bodies; small predicted errors come first."""
        if len(self.ladders) < 2:
            return None
        others = sorted(self.leaps(choice), key=lambda leap: (_error(leap), self.expected(leap)))
        return self.first_cheaper(choice, others[:LEAPS])

    def first_cheaper(self, choice: Choice, others: list[Choice]) -> Choice | None:
        """The first of the others that is adequate and whose run takes fewer operations."""
        least = self.confirmation.run_cost(model_of(choice))
        for other in others:
            if self.exhausted:
                return None
            if self.fits(other, SPARE * least) and self.confirmation.run_cost(model_of(other)) < least:
                return other
        return None

    def alike(self, choice: Choice) -> Iterator[Choice]:
        """Choices predicted to be much cheaper with the same rung for all bodies."""
        if len(self.ladders) < 2:
            return
        by_rung = {name: {step.rung: step for step in self.steps(name)} for name in self.ladders}
        first, *rest = by_rung.values()
        for rung in first:
            if all(rung in ladder for ladder in rest):
                other = {name: ladder[rung] for name, ladder in by_rung.items()}
                if self.expected(other) <= LEAP * self.expected(choice):
                    yield other

    def leaps(self, choice: Choice) -> Iterator[Choice]:
        """Choices predicted to be much cheaper, of rungs that are Pareto-optimal in error, operations and frequency;
        for all bodies at once or, if these combinations are too many, for every pair.
        """
        best = {name: _best(self.steps(name)) for name in self.ladders}
        many = prod(map(len, best.values())) > MANY
        enough = LEAP * self.expected(choice)
        for names in combinations(self.ladders, 2) if many else (tuple(self.ladders),):
            for steps in product(*(best[name] for name in names)):
                other = choice | dict(zip(names, steps, strict=True))
                if self.expected(other) <= enough and _error(other) <= self.hopeless:
                    yield other

    def steps(self, name: str) -> list[Step]:
        """Rungs of a body that may be adequate: with no large predicted error and no large measured one."""
        return [s for s in self.ladders[name] if s.error <= self.hopeless and s.rung not in self.missed[name]]

    def expected(self, choice: Choice) -> float:
        """Predicted operations of a choice."""
        return self.confirmation.cost.of(choice.values())


def _error(choice: Choice) -> float:
    """Predicted error of the whole scene: the sum over its bodies."""
    return float(np.sum([step.error for step in choice.values()]))


def _best(steps: list[Step]) -> list[Step]:
    """The Pareto-optimal steps in error, operations and frequency; of equal ones the first."""
    merits = np.array([(step.error, step.operations, step.fastest) for step in steps]).reshape(-1, 3)
    ladders = []
    for i, step in enumerate(steps):
        as_good = np.all(merits <= merits[i], axis=1)
        better = as_good & np.any(merits < merits[i], axis=1)
        if not np.any(better) and not np.any(as_good[:i]):
            ladders.append(step)
    return ladders
