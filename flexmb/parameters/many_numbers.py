"""Derivatives of the tables by many numbers at once, and which of them hold at other values of the numbers too.

A scene is compiled four times or more for each derivative by interpolation (`flexmb.parameters.spectral`). Numbers of
different bodies change different entries of the tables. So each number is changed once to see which entries it
concerns; then numbers with no entry in common are changed together, each by the same share of its scale, as one takes
the columns of a sparse Jacobian together (Curtis, Powell & Reid 1974). Where the entries of a number change in
proportion at both of two points, on either side of its value, they are linear in it, and no more points are needed. A
group in which anything is unexpected is differentiated one by one.

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

from flexmb.parameters.numbers import Number
from flexmb.parameters.spectral import ENOUGH, WIDTHS, Derivative, NotSmooth, Parts, derivative, nought
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


BEHIND = float(np.sqrt(0.5))
"""The distance of the second point over that of the first: not of its size, which would hide what is even or odd."""

Tables = Callable[[Mapping[str, float]], Real]
"""All floats (n,) of the tables with other values, by name of the number; ValueError where there are none."""


def derivatives_together(
    tables: Tables, chosen: Sequence[Number], parts: Parts, by: Callable[[Number], Derivative],
    widths: Mapping[str, float],
) -> list[Derivative]:  # fmt: skip
    """d tables/dp (n,) for each of these numbers; `by` finds it for one number, or says what is wrong with it. widths:
    those at which derivatives were found nearby, by name."""
    concerned = [_concerned(tables, number) for number in chosen]
    derivatives = dict[int, Derivative]()
    for group in _groups(concerned):
        derivatives |= _linear(tables, chosen, concerned, group, parts)
        left = [k for k in group if k not in derivatives]
        if len(left) > 1:
            first = min(widths.get(chosen[k].name, WIDTHS[0]) for k in left)
            derivatives |= _of_group(tables, chosen, concerned, left, parts, first)
    return [derivatives[k] if k in derivatives else by(number) for k, number in enumerate(chosen)]


def _concerned(tables: Tables, number: Number) -> Flags | None:
    """(n,) which entries change with a number; None where its value cannot change as far."""
    try:
        return np.asarray(tables({number.name: number.value + WIDTHS[0] * number.scale}) != tables({}))
    except ValueError:
        return None


def _groups(concerned: Sequence[Flags | None]) -> list[list[int]]:
    """Numbers with no entry in common, each added to the first group that it fits in."""
    groups = list[list[int]]()
    taken = list[Flags]()
    for k, own in enumerate(concerned):
        if own is None:
            continue
        place = next((i for i, other in enumerate(taken) if not np.any(own & other)), None)
        if place is None:
            groups.append([k])
            taken.append(own)
        else:
            groups[place].append(k)
            taken[place] = taken[place] | own
    return groups


def _linear(
    tables: Tables, chosen: Sequence[Number], concerned: Sequence[Flags | None], group: Sequence[int], parts: Parts
) -> dict[int, Derivative]:
    """Derivatives by those numbers of a group in which the entries that they concern are linear, to what counts as
    rounding in steady derivatives."""
    middle = tables({})
    allowed = LINEAR * parts.sizes(middle)
    try:
        now = tables({chosen[k].name: chosen[k].value - BEHIND * WIDTHS[0] * chosen[k].scale for k in group})
    except ValueError:
        return {}
    own = {k: mask for k, mask in enumerate(concerned) if k in group and mask is not None}
    elsewhere = ~np.any(list(own.values()), axis=0)
    if np.any(np.abs(now - middle)[elsewhere] > allowed[elsewhere]):
        return {}
    found = dict[int, Derivative]()
    for k, mask in own.items():
        number, step = chosen[k], WIDTHS[0] * chosen[k].scale
        change = np.where(mask, tables({number.name: number.value + step}) - middle, 0.0)
        if np.all(np.abs(now - middle + BEHIND * change)[mask] <= allowed[mask]):
            found[k] = Derivative(change / step, 0.0)
    return found


def _of_group(
    tables: Tables, chosen: Sequence[Number], concerned: Sequence[Flags | None], group: Sequence[int],
    parts: Parts, first: float,
) -> dict[int, Derivative]:  # fmt: skip
    """Derivatives by the numbers of a group, nothing where they are not found together.

    Errors are those of each number alone: relative to the largest derivative by it in each part of the tables.
    """
    own = {k: mask for k, mask in enumerate(concerned) if k in group and mask is not None}
    allowed = nought(parts.sizes(tables({})))
    places = [np.flatnonzero(_within(mask, part)) for mask in own.values() for part in parts.places]

    def at(share: float) -> Real:
        return tables({chosen[k].name: chosen[k].value + share * chosen[k].scale for k in group} if share else {})

    try:
        rates = derivative(at, 0.0, 1.0, parts._replace(places=[place for place in places if len(place)]), first)
    except (NotSmooth, ValueError):
        return {}
    strays = np.where(np.any(list(own.values()), axis=0), 0.0, np.abs(rates.values))
    if any(np.any(strays[part] > allowed[part]) for part in parts.places):
        return {}
    return {k: rates._replace(values=np.where(mask, rates.values / chosen[k].scale, 0.0)) for k, mask in own.items()}


def _within(mask: Flags, part: slice | Index) -> Flags:
    flags = np.zeros(len(mask), bool)
    flags[part] = mask[part]
    return flags
