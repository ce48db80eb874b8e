"""A row of the table of what must hold: what it says, its goal, how it is measured; and what a measurement found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from typing import Literal, NamedTuple

import msgspec
import numpy as np

from tests.benchmarks.rivals import ROUNDS, turns

Sense = Literal["at least", "at most"]
TO_ROUNDING = 1e-9  # of the largest component: two routes to the same accelerations, at most 100 bodies


class Call(NamedTuple):
    """Something to time: `call` evaluates `samples` samples, `result` gives what the last call found."""

    call: Callable[[], object]
    samples: int
    result: Callable[[], np.ndarray]


class Measured(msgspec.Struct, frozen=True):
    """What was found. `low` and `high`: quartiles over the rounds of a run, or the least and largest of few values.

    `difference`: how far the results of rivals are apart, of the largest component, found before they were timed; None
    where there is nothing to compare.
    """

    value: float
    low: float
    high: float
    detail: str
    difference: float | None = None


@dataclass(frozen=True)
class Row:
    """`name` is for the command line; `what` and `group` are for readers; `unit` is "x" or "s" or a noun.

    `searched`: the settings among which a row at equal error takes the fastest one of each code.
    """

    name: str
    group: str
    what: str
    goal: float
    measure: Callable[[], Measured]
    sense: Sense = "at least"
    unit: str = "x"
    searched: str = ""

    def is_met(self, value: float) -> bool:
        """Whether the goal is reached; what is not a number reaches none."""
        return isfinite(value) and (value >= self.goal if self.sense == "at least" else value <= self.goal)


class RivalsDiffer(ArithmeticError):
    """Rivals that do not compute the same thing are not timed."""


def how_many_times(native: Call, rival: Call, within: float = TO_ROUNDING, rounds: int = ROUNDS) -> Measured:
    """Time per sample of the rival over that of native, in turns, after both have given the same result.

    Raises RivalsDiffer where results are farther apart than `within` of the largest component.
    """
    difference = compared(native, rival, within)
    seconds = turns(native.call, rival.call, rounds=rounds) / [native.samples, rival.samples]
    mine, other = np.median(seconds, axis=0)
    return measured(seconds[:, 1] / seconds[:, 0], f"{duration(mine)} against {duration(other)}", difference)


def measured(values: np.ndarray, detail: str, difference: float | None = None) -> Measured:
    """Median and quartiles of one value for each round."""
    low, middle, high = np.percentile(values, (25, 50, 75)).tolist()
    return Measured(middle, low, high, detail, difference)


def compared(native: Call, rival: Call, within: float) -> float:
    """Largest distance of any sample of either from the rival's first one, of its largest component.

    Raises RivalsDiffer, also for what is not finite.
    """
    native.call()
    rival.call()
    mine, other = (np.atleast_2d(each.result()) for each in (native, rival))
    if mine.shape[1] != other.shape[1] or 0 in (*mine.shape, *other.shape):
        raise RivalsDiffer(f"results of shape {mine.shape} and {other.shape}")
    distance = max(np.max(np.abs(each - other[0])) for each in (mine, other))
    difference = float(distance / np.max(np.abs(other[0])))
    if not difference <= within:
        raise RivalsDiffer(f"results are {difference:.1e} apart, of the largest component; allowed: {within:.1e}")
    return difference


def duration(seconds: float) -> str:
    """In the unit that reads best."""
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs")):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
