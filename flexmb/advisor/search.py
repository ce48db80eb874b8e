"""The cheapest adequate model: up until one fits, then down as far as the runs allow.

What a run costs follows from the highest frequency in it, and then from the operations of an evaluation. So the way up
allows one highest frequency after the other, lowest first, and all bodies the best that it allows; the way down leaps
to what is predicted to be much cheaper, whatever the number of bodies that change, and then changes one at a time.

Every decision is a run of the whole scene; nothing is random and nothing is timed.
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
from flexmb.advisor.models import LEVELS, BodyModel, Model

HOPELESS = 20.0
"""Models predicted to miss the tolerance by this factor are tried last on the way up and not at all on the way down."""
MISSED = 2.0
"""A rung that missed the tolerance by this factor is not tried again when other bodies have become coarser."""
SLACK, WORTH = 1.5, 0.9
"""Predicted cost of what is tried on the way down, of what fits: of a scene with one body more, as predictions may be
off; with several bodies what makes a difference."""
LEAP, LEAPS, MANY = 0.75, 15, 20_000
"""Leaps: to what is predicted to cost that part of a choice; so many are tried; of so many at most, else of pairs."""
FINALISTS = 3
"""Adequate models, by the cost of their fine runs, for which the best method is looked for."""

Choice = dict[str, Step]


@dataclass(frozen=True)
class Found:
    """A model and the method that suits it best; `exhausted`: the budget ended the walk down."""

    model: Model
    method: RunMethod
    exhausted: bool


def search(ladders: dict[str, tuple[Step, ...]], confirmation: Confirmation, budget: float) -> Found | None:
    """The cheapest adequate model that the walk finds, or None where no choice of rungs is adequate.

    `ladders`: by body, its steps. `budget`: operations of the walk's runs, and what is around them, after which the
    walk down ends.
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
        self.confirmation = confirmation
        known = highest_frequency(confirmation.bench.scene, confirmation.reference.model)
        self.ladders = {  # what is finer than the reference is dearer
            name: tuple(step for step in steps if step.fastest <= known) for name, steps in ladders.items()
        }
        self.most = confirmation.bench.spent + budget
        self.missed: dict[str, set[BodyModel]] = {name: set() for name in ladders}
        self.hopeless = HOPELESS * confirmation.tolerance

    def fits(self, choice: Choice) -> bool:
        return self.confirmation.adequate(model_of(choice))

    @property
    def exhausted(self) -> bool:
        return self.confirmation.bench.spent > self.most

    def up(self) -> Choice | None:
        """The first choice on the way up that fits.

        Where none does, those that were predicted to be hopeless have their turn, and then every rung of every body.
        """
        way = list(self.way())
        hopeful = [choice for choice in way if _error(choice) <= self.hopeless]
        others = [choice for choice in way if _error(choice) > self.hopeless]
        return next(filter(self.fits, (*hopeful, *others, *self.finest())), None)

    def way(self) -> Iterator[Choice]:
        """For each highest frequency, lowest first, the rungs with the least predicted errors that have no higher."""
        before: Choice | None = None
        for highest in sorted({0.0} | {step.fastest for steps in self.ladders.values() for step in steps}):
            choice = self.finest_below(highest, LEVELS)
            if choice != before:
                yield choice
            before = choice

    def finest_below(self, highest: float, levels: tuple[str, ...]) -> Choice:
        """Of every body the rung with the least predicted error that has no higher frequency, at one of the levels; the
        dearest of those, for where nothing is predicted."""
        return {
            name: min(
                (s for s in steps if s.fastest <= highest and s.rung.level in ("rigid", *levels)),
                key=lambda s: (s.error, -s.operations),
            )
            for name, steps in self.ladders.items()
        }

    def finest(self) -> Iterator[Choice]:
        """Every rung of every body, cheapest first, with all others at their dearest."""
        dearest = {name: max(steps, key=lambda s: (s.fastest, s.operations)) for name, steps in self.ladders.items()}
        for name, steps in self.ladders.items():
            for step in sorted(steps, key=lambda s: self.expected({name: s})):
                yield dearest | {name: step}

    def down(self, choice: Choice) -> None:
        """To cheaper choices that fit until there are none or the budget is spent: simpler levels for all bodies, the
        same rung for all, leaps, body by body."""
        highest = max((step.fastest for step in choice.values()), default=0.0)
        simpler = (self.finest_below(highest, LEVELS[:n]) for n in range(1, len(LEVELS)))
        choice = next(filter(self.fits, simpler), choice)
        choice = self.first_cheaper(choice, sorted(self.alike(choice), key=self.expected)) or choice
        while True:
            while (other := self.leap(choice)) is not None:
                choice = other
            settled = self.settled(choice)
            if settled == choice:
                return
            choice = settled

    def settled(self, choice: Choice) -> Choice:
        """Body by body the cheapest rung with which the whole still fits, until nothing changes."""
        changed = True
        while changed:
            changed = False
            for name in self.ladders:
                better = self.cheaper(choice, name)
                if better is not None:
                    choice, changed = better, True
        return choice

    def cheaper(self, choice: Choice, name: str) -> Choice | None:
        """The choice with a cheaper rung of one body: of those that fit, the cheapest as run."""
        slack = SLACK if len(self.ladders) == 1 else WORTH
        enough, best, least = self.expected(choice), None, self.confirmation.run_cost(model_of(choice))
        others = [choice | {name: step} for step in self.steps(name)]
        for other in sorted(others, key=self.expected):
            if self.exhausted or self.expected(other) > slack * enough:
                break
            if self.fits(other) and self.confirmation.run_cost(model_of(other)) < least:
                best, least = other, self.confirmation.run_cost(model_of(other))
                enough = self.expected(other)
            if self.confirmation.error(model_of(other)) > MISSED * self.confirmation.tolerance:
                self.missed[name].add(other[name].rung)
        return best

    def leap(self, choice: Choice) -> Choice | None:
        """A choice much cheaper that fits, with other rungs for several bodies; those with the least errors first."""
        if len(self.ladders) < 2:
            return None
        others = sorted(self.leaps(choice), key=lambda each: (_error(each), self.expected(each)))
        return self.first_cheaper(choice, others[:LEAPS])

    def first_cheaper(self, choice: Choice, others: list[Choice]) -> Choice | None:
        """The first of the others that fits and takes fewer operations as run."""
        least = self.confirmation.run_cost(model_of(choice))
        for other in others:
            if self.exhausted:
                return None
            if self.fits(other) and self.confirmation.run_cost(model_of(other)) < least:
                return other
        return None

    def alike(self, choice: Choice) -> Iterator[Choice]:
        """Choices predicted to be much cheaper with the same rung for all bodies."""
        if len(self.ladders) < 2:
            return
        by_rung = {name: {step.rung: step for step in self.steps(name)} for name in self.ladders}
        first, *rest = by_rung.values()
        for rung in first:
            if all(rung in each for each in rest):
                other = {name: each[rung] for name, each in by_rung.items()}
                if self.expected(other) <= LEAP * self.expected(choice):
                    yield other

    def leaps(self, choice: Choice) -> Iterator[Choice]:
        """Choices predicted to be much cheaper, of rungs that are the best in something: error, operations, frequency;
        of all bodies at once or, where these are too many, of every two."""
        best = {name: _best(self.steps(name)) for name in self.ladders}
        many = prod(map(len, best.values())) > MANY
        enough = LEAP * self.expected(choice)
        for names in combinations(self.ladders, 2) if many else (tuple(self.ladders),):
            for steps in product(*(best[name] for name in names)):
                other = choice | dict(zip(names, steps, strict=True))
                if self.expected(other) <= enough and _error(other) <= self.hopeless:
                    yield other

    def steps(self, name: str) -> list[Step]:
        """Rungs of a body that there is hope for."""
        return [s for s in self.ladders[name] if s.error <= self.hopeless and s.rung not in self.missed[name]]

    def expected(self, choice: Choice) -> float:
        """Predicted operations."""
        return self.confirmation.cost.of(choice.values())


def _error(choice: Choice) -> float:
    """Predicted error of the whole: those of its bodies add up."""
    return float(np.sum([step.error for step in choice.values()]))


def _best(steps: list[Step]) -> list[Step]:
    """Those that no other is as good as in everything."""
    merits = np.array([(step.error, step.operations, step.fastest) for step in steps]).reshape(-1, 3)
    found = []
    for i, step in enumerate(steps):
        as_good = np.all(merits <= merits[i], axis=1)
        better = as_good & np.any(merits < merits[i], axis=1)
        if not np.any(better) and not np.any(as_good[:i]):
            found.append(step)
    return found
