"""Derivatives of smooth functions of one number by interpolation in Chebyshev's points, with an estimate of the error.

The functions lead from a number of a scene to its tables: finite elements, an eigenproblem, integrals over modes. Most
elements are polynomials of low degree in the number, for which the derivative of the interpolant is exact to rounding;
for all other analytic ones it converges geometrically with the number of points (Trefethen, Approximation Theory and
Approximation Practice, ch. 8, 21). The points spread over an eighth of the number, or over less of it where a
singularity is near: far more than the steps of finite differences, so that rounding errors are hardly magnified.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np

from flexmb.typing import Index, Real

INTERVALS = (2, 4, 8, 16)  # of the points cos(pi k / n), each set of which contains the one before
WIDTHS = (2.0**-3, 2.0**-5, 2.0**-8, 2.0**-11, 2.0**-14)  # half-widths that are tried, relative to the scale
ENOUGH = 1e-11  # relative error at which no smaller width is tried
HOPELESS = 1e-5  # an error with half of the points that all of them will not bring down to ENOUGH
LARGEST = 1e-9  # relative error that is accepted
# Shares of values over scale, and of values over width, that count as rounding. That of an eigenproblem is some hundred
# eps, and is magnified by the inverse of the width.
ROUNDING, MAGNIFIED = 1e-11, 2e-14
NOUGHT = 3.0  # times this rounding: a part whose derivatives are no larger has none, and what is there is noise


class Parts(NamedTuple):
    """Entries (n,) of tables in parts, in each of which errors are relative to its size.

    whole (n,): the size of the table that an entry is in, 0 where each part stands alone. A part whose entries are all
    rounding beside that is zero: its own size would be that of the noise to be judged by it.
    """

    places: Sequence[slice | Index]
    whole: Real | None = None

    def sizes(self, values: Real) -> Real:
        """(n,) the size of the part of each entry, with these values, or that of its table if the part is zero."""
        sizes = np.zeros(len(values))
        for part in self.places:
            own = np.max(np.abs(values[part]), initial=0.0)
            table = 0.0 if self.whole is None else np.max(self.whole[part], initial=0.0)
            sizes[part] = own if own > ROUNDING * table else table
        return sizes


class NotSmooth(ValueError):
    """A function has no derivative, or none that is found to LARGEST; the message says what was met."""


class Derivative(NamedTuple):
    """Derivatives (n,), the estimate of their relative error, and the half-width, over scale, of their interval."""

    values: Real
    error: float
    width: float = WIDTHS[0]


def derivative(
    function: Callable[[float], Real], x: float, scale: float, parts: Parts, first: float = WIDTHS[0]
) -> Derivative:
    """df/dx (n,) at x of a function that returns (n,), or raises ValueError where it is not defined.

    scale: size of changes of x that change the function by its own size. Errors are relative to the largest derivative,
    or value over scale, in each part of the values. first: the half-width that is tried first, that of a point nearby.
    NotSmooth where the estimated error is too large.
    """
    middle = function(x)
    best, trouble = Derivative(np.zeros_like(middle), np.inf), ""
    nearby = [(False, first)] if first != WIDTHS[0] else []
    for is_hasty, width in (*nearby, *product((True, False), WIDTHS)):
        try:
            found, settled = _on_interval(function, x, width * scale, middle, scale, parts, is_hasty)
        except ValueError as error:  # that the value is outside of its range: a smaller interval may not be
            trouble = str(error)
            continue
        best = min(best, found._replace(width=width), key=lambda estimate: estimate.error)
        if best.error <= ENOUGH or found.error <= LARGEST and settled:
            break
    if not best.error <= LARGEST:
        raise NotSmooth(
            trouble
            if best.error == np.inf
            else f"it is known to {best.error:.1g} of its size only: there is a kink, frequencies nearly cross, or the "
            "effect of the number drowns in rounding"
        )
    return best


def _on_interval(
    function: Callable[[float], Real], x: float, width: float, middle: Real, scale: float, parts: Parts, is_hasty: bool
) -> tuple[Derivative, bool]:
    """By interpolation on [x - width, x + width]: points are added until the derivative does not change.

    Also whether what it still changes by is rounding, which a smaller interval would magnify: twice as many points
    square an error that is of the interpolation, so that the one before tells what is left of it.
    If `is_hasty`, no points are added where the errors, if they fall as a power of the number of points, would not come
    down to ENOUGH: a smaller interval needs fewer.
    """
    odd, even = dict[float, Real](), dict[float, Real]()  # f(x + d) -+ f(x - d) by d / width
    size = np.abs(middle)
    before, error, earlier = None, np.inf, np.inf
    for intervals in INTERVALS:
        places, weights = _rule(intervals)
        for place in places:
            if place not in odd:
                ahead, behind = function(x + place * width), function(x - place * width)
                odd[place], even[place] = ahead - behind, ahead + behind - 2.0 * middle
                size = np.maximum(size, np.maximum(np.abs(ahead), np.abs(behind)))
        now = sum(weight * odd[place] for place, weight in zip(places, weights, strict=True)) / width
        if before is not None:
            # The middle is none of the points: it must lie on the interpolant of the others.
            jump = sum(weight * even[place] for place, weight in zip(places, _rest(intervals), strict=True)) / width
            rounding = parts.sizes(size) * (ROUNDING / scale + MAGNIFIED / width)
            earlier = error
            error = max(_relative(change, now, rounding, parts.places) for change in (now - before, jump))
            is_slow = is_hasty and error ** (INTERVALS[-1] / intervals) > ENOUGH
            if error <= ENOUGH or is_slow or intervals == INTERVALS[-2] and error > HOPELESS:
                break
        before = now
    return Derivative(now, error), earlier**2 <= ENOUGH


def nought(sizes: Real) -> Real:
    """The largest derivatives, for a change of a number by its scale, that are rounding in parts of these sizes."""
    return NOUGHT * ROUNDING * sizes


def _relative(change: Real, derivative: Real, rounding: Real, parts: Sequence[slice | Index]) -> float:
    """The largest change of a part's derivatives beyond rounding, relative to the largest of these derivatives."""
    worst = 0.0
    for part in parts:
        off = np.max(np.abs(change[part]), initial=0.0)
        largest = np.max(np.abs(derivative[part]), initial=0.0)
        if not np.isfinite(off):
            return np.inf
        noise = np.max(rounding[part], initial=0.0)
        if off > noise and not max(off, largest) <= NOUGHT * noise:
            worst = max(worst, off / largest if largest > 0.0 else np.inf)
    return worst


@cache
def _rule(intervals: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Positive places d in [-1, 1], and the weights of f(d) - f(-d) in f'(0): the derivative of the interpolant.

    Its barycentric weights are those of Chebyshev's points of the second kind (Trefethen, ch. 5), ch. 21 for f'.
    """
    half = intervals // 2
    places = np.array([np.cos(np.pi * k / intervals) for k in range(half)])
    signs = np.array([(-1.0) ** (k - half) * (0.5 if k == 0 else 1.0) for k in range(half)])
    # A place in two sets is the same number in both: pi k / n is, for powers of two.
    return tuple(places.tolist()), tuple((-signs / places).tolist())


@cache
def _rest(intervals: int) -> tuple[float, ...]:
    """Weights of f(d) + f(-d) - 2 f(0) in the value at 0 of the interpolant of all points but 0, less f(0).

    Without the point at 0, the barycentric weights of the others are multiplied by their distances from it.
    """
    places, _ = _rule(intervals)
    half = intervals // 2
    ratios = [(-1.0) ** (k - half) * (0.5 if k == 0 else 1.0) for k in range(half)]
    total = 2.0 * sum(ratios)
    return tuple(ratio / total for ratio in ratios)
