"""Derivatives of tables that stay what they are when numbers take other values: those of entries linear in one number.

Masses, stiffnesses and dampings enter tables linearly, so that an identification, which differentiates one scene at
many values of its numbers, needs most of these derivatives once. A number is *steady* where, for a change by an eighth,
all entries that it concerns change as its derivatives say, no other number concerns them, and all numbers changed at
once change every entry by what each of them does alone. A smooth function that is linear so far is linear everywhere; a
kink shows where the tables at other values are not what the derivatives predict.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from flexmb.parameters.spectral import ENOUGH, Derivative
from flexmb.typing import Flags, Index, Real

LINEAR = 1e-13
"""What rounding leaves of a linear change by an eighth, relative to a part of the tables, in which derivatives are
compared too (`flexmb.parameters.spectral`): the slope is then steady to 1e-12."""


class First(NamedTuple):
    """Another value of a number, the entries of the tables (k,) that differ with it, and what they are then."""

    value: float
    places: Index
    entries: Real


class Steady(NamedTuple):
    """values: of all numbers where they were differentiated, with the tables `middle` (n,) there, and the sizes (n,) of
    the parts they are in; rates: derivatives by the steady ones, by name; changing (n,): entries that other numbers
    concern."""

    values: dict[str, float]
    rates: dict[str, Derivative]
    middle: Real
    sizes: Real
    changing: Flags

    def predicts(self, middle: Real, values: Mapping[str, float]) -> bool:
        """Whether the tables at other values are what the derivatives make of them, which then hold there too."""
        change = sum(
            (rate.values * (values[name] - self.values[name]) for name, rate in self.rates.items()),
            np.zeros_like(middle),
        )
        off = np.abs(middle - self.middle - change)
        allowed = LINEAR * self.sizes + ENOUGH * np.maximum(np.abs(middle), np.abs(self.middle))
        return bool(np.all((off <= allowed) | self.changing))


def steady(
    tables: Callable[[Mapping[str, float]], Real], middle: Real, sizes: Real, values: Mapping[str, float],
    firsts: Mapping[str, First], rates: Sequence[Derivative],
) -> Steady:  # fmt: skip
    """Which of the numbers are steady at their `values`; none where that cannot be seen.

    tables: all entries (n,) at other values by name, ValueError where there are none; firsts: by name; rates: the
    derivatives, in the order of `values`.
    """
    none = Steady(dict(values), {}, middle, sizes, np.ones(len(middle), bool))
    if not values or any(name not in firsts for name in values):
        return none
    taken = np.zeros(len(middle), np.int64)
    for name in values:
        taken[firsts[name].places] += 1
    rates_of = {
        name: rate
        for (name, value), rate in zip(values.items(), rates, strict=True)
        if np.all(taken[firsts[name].places] == 1) and _is_linear(middle, sizes, value, firsts[name], rate)
    }
    changing = np.zeros(len(middle), bool)
    others = {name: firsts[name].value for name in values if name not in rates_of}
    for name in others:
        changing[firsts[name].places] = True
    try:
        expected = tables(others).copy() if others else middle.copy()
        together = tables({name: firsts[name].value for name in values})
    except ValueError:
        return none
    for name in rates_of:
        expected[firsts[name].places] = firsts[name].entries
    if np.any(np.abs(together - expected) > LINEAR * sizes):
        return none
    return Steady(dict(values), rates_of, middle, sizes, changing)


def _is_linear(middle: Real, sizes: Real, value: float, first: First, rate: Derivative) -> bool:
    at, change = first.places, first.value - value
    elsewhere = np.ones(len(middle), bool)
    elsewhere[at] = False
    off = np.abs(first.entries - middle[at] - change * rate.values[at])
    return bool(np.all(off <= LINEAR * sizes[at])) and not np.any(rate.values[elsewhere])
