"""Numerical uncertainty of one engine's result, from its own runs at successive efforts.

Let f_1, f_2, f_3 be the results at the last three efforts, coarse to fine, and d_12 = max |f_1 - f_2|, d_23 likewise.

**Fixed step** h_1 > h_2 > h_3. If f(h) = f + C h^p with r_12 = h_1/h_2 and r_23 = h_2/h_3, then

    d_12 / d_23 = r_23^p (r_12^p - 1) / (r_23^p - 1),         |f_3 - f| = d_23 / (r_23^p - 1).

The first equation gives the observed order p (for equal ratios p = log(d_12/d_23) / log r); the second, Richardson's
estimate, gives U with the safety factor 1.25 of the grid convergence index for three grids (Roache 1998). It is used
where p is within `ORDER_BAND` of a whole number: all one-step and multistep methods have whole orders, so a p that is
not is a sign of being outside the asymptotic range. No credit is given for more than order `ORDER_CREDIT`.
Outside the band but with p at least 1 - ORDER_BAND, the method is assumed to be of order 1: U = 1.25 d_23/(r_23 - 1).
With a smaller p the runs have not begun to converge, or have reached round-off: U = 3 max(d_12, d_23), with the factor
of the grid convergence index for an unproven order.

**Tolerance.** The error is not a power of the tolerance, but it decreases. If the finest error e_3 is at most half the
one before, d_23 >= e_2 - e_3 >= e_3: the difference bounds the error. This is assumed if d_12 >= 2 d_23; otherwise
U = 3 max(d_12, d_23) again. The decrease of the error scatters: where a factor q is expected, e_3 <= S/q e_2 with a
scatter S. With e_2 <= d_23 + e_3 it follows that

    U = S/(q - S) d_23,        at most 3 d_23.

q is the smaller of d_12 / d_23 and the ratio of the tolerances, and S is `SCATTER`. U is at least d_23, since errors
may have ceased to decrease, which the differences do not show. The numbers of evaluations N show it, if they are
counted. If they grow by at most a factor `NO_GROWTH`, something other than the tolerance determines the steps
(stability, sample times, a closed chain at a singular position): U = `UNCONTROLLED_SAFETY` d_23. Otherwise
p = log(d_12 / d_23) / log(N_2 / N_1) is the observed order in the mean step. One value of p may be chance, for example
by the errors at the kinks of a stop; four efforts give two. If both agree within a factor of `SAME_ORDER` and do not
exceed `LARGEST_ORDER_IN_WORK`, which no method does, U may be less than d_23, with q the smaller of d_12 / d_23 and
(N_3 / N_2)^p. The exception are evaluations whose logarithmic growth, relative to the tolerance, exceeds the one before
by more than a factor `EXCESS_GROWTH`: then the error control reacts to round-off that the scene amplifies. The values
of these constants were found over the library of cases, see docs/verdicts.md.

**Round-off.** `flexmb.run.rounding` has the bound that is added to it.

What the condition of a scene makes of rounding is not in it. Where a mass matrix is badly conditioned, or a motion is
chaotic, the same roundings count for more: a backward-stable algorithm gives the exact result of a scene whose numbers
are off by as many units in the last place as its arithmetic rounds (Higham 2002, 1.5). Variants may ask for runs with
moved inputs (`crosscheck.running.moved`). Their distance d from the run of the scene, for a unit in the last place of
all numbers, adds

    LIKELY sqrt(ROUNDINGS n / 12) d.

**Rest.** Efforts that made as many evaluations and gave the same result in every channel were ignored by the engine,
and tell nothing. Derivatives of a state that rests are the exception: where nothing moves, every effort has that state.

Runs that are not a ladder of finite results at decreasing efforts have an infinite U with the reason, and comparisons
with it are unresolved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from flexmb.run.channels import distance
from flexmb.run.rounding import roundoff_floor
from flexmb.typing import Real

SAFETY = 1.25
UNPROVEN_SAFETY = 3.0
RUNGS = 4  # the most efforts of a ladder that are used
ORDER_BAND = 0.1
SCATTER = 10.0
UNCONTROLLED_SAFETY = 15.0
SAME_ORDER = 1.25
LARGEST_ORDER_IN_WORK = 12.0
NO_GROWTH = 1.03  # ratio of the evaluations at two tolerances
EXCESS_GROWTH = 1.5  # ratio of the logarithm of that ratio to the one expected from the coarser pair
ORDER_CREDIT = 4.0
LARGEST_ORDER = 16.0
LARGEST_RATIO = 1e6  # of two steps between which an order is estimated


@dataclass(frozen=True)
class Uncertainty:
    """U of one channel of one result: `envelope` (T,), which never decreases; its maximum `value`; how it was found."""

    envelope: Real
    value: float
    how: str
    order: float | None = None


@dataclass(frozen=True)
class RungSignal:
    """One channel (T, k) of one run of a ladder; `effort` is its step (s) or relative tolerance.

    `evaluations` of the right-hand side are 0 if not counted.
    """

    effort: float
    values: Real
    evaluations: int = 0


def unknown(samples: int, why: str) -> Uncertainty:
    """An infinite U, for the reason `why`."""
    return Uncertainty(np.full(samples, np.inf), float("inf"), f"unknown: {why}")


def at_rest(samples: int, size: float, evaluations: int, joints: int = 0) -> Uncertainty:
    """That of a state which rests, and is the same at every effort: round-off of signals of that size."""
    if not (0.0 <= size < np.inf and 0 <= evaluations < np.inf):
        return unknown(samples, f"{evaluations} evaluations of a signal of size {size:g} leave no round-off to be told")
    floor = roundoff_floor(size, max(evaluations, samples), joints)
    return Uncertainty(np.full(samples, floor), floor, "the state rests at every effort")


def estimate(channel: str, kind: str, rungs: Sequence[RungSignal], size: float, joints: int = 0) -> Uncertainty:
    """U of the finest of `rungs` (coarse to fine, all of one method; `kind` is "step" or "tolerance").

    The last three are used, of tolerances the last four. `size` is the magnitude of the signal's family, `joints`
    how many its arithmetic passes at most. Never raises: U is infinite if it cannot be estimated.
    """
    samples = len(rungs[-1].values) if rungs else 0
    fault = _fault(kind, rungs, size)
    if fault:
        return unknown(samples, fault)
    floor = roundoff_floor(size, max(rungs[-1].evaluations, samples), joints)
    gaps = [distance(channel, coarse.values, fine.values) for coarse, fine in pairwise(rungs[-RUNGS:])]
    if len(gaps) == 1:
        return _enveloped(UNPROVEN_SAFETY, gaps[0], floor, "3 x the difference of the only two efforts", None)
    factor, gap, how, order = _by_tolerances(rungs, gaps) if kind == "tolerance" else _by_steps(rungs, gaps)
    return _enveloped(factor, gap, floor, how, order)


def _fault(kind: str, rungs: Sequence[RungSignal], size: float) -> str:
    """Why U cannot be estimated from the runs; "" if it can."""
    if len(rungs) < 2:
        return "fewer than two efforts finished with different results"
    if kind not in ("step", "tolerance"):
        return f'efforts of kind "{kind}" have no order'
    efforts = [rung.effort for rung in rungs]
    if not all(0.0 < fine < coarse < np.inf for coarse, fine in pairwise(efforts)):
        return f"the efforts {', '.join(f'{effort:g}' for effort in efforts)} do not fall to a positive number"
    if any(rung.values.shape != rungs[-1].values.shape for rung in rungs) or rungs[-1].values.size == 0:
        return "the efforts have results of different shapes, or empty ones"
    if not all(np.all(np.isfinite(rung.values)) for rung in rungs):
        return "an effort has values that are not numbers"
    evaluations = [rung.evaluations for rung in rungs]
    if not (all(0 <= count < np.inf for count in evaluations) and 0.0 <= size < np.inf):
        count = next((evaluation for evaluation in evaluations if not 0 <= evaluation < np.inf), evaluations[-1])
        return f"{count} evaluations of a signal of size {size:g} leave no round-off to be told"
    return ""


def _enveloped(factor: float, gap: Real, floor: float, how: str, order: float | None) -> Uncertainty:
    """U that never decreases over time, plus the round-off."""
    with np.errstate(over="ignore"):
        envelope = np.maximum.accumulate(factor * gap) + floor
    if not np.all(np.isfinite(envelope)):
        return unknown(len(envelope), "the runs are so far apart that their distance is not finite")
    return Uncertainty(envelope, float(envelope[-1]), how, order)


def spatial(channel: str, coarse: Real, fine: Real, ratio: float, order: float) -> Real:
    """U (T,) of a spatial discretisation, for its *coarse* result: f_c - f = (f_c - f_f) r^p / (r^p - 1), safety 1.25.

    `order` is the known order p of the discretisation and `ratio` r its refinement. Infinite for results of different
    shapes or with values that are not finite, and for an invalid ratio or order.
    """
    samples = len(coarse)
    comparable = coarse.shape == fine.shape and coarse.size > 0 and np.all(np.isfinite((coarse, fine)))
    if not (comparable and 1.0 < ratio < np.inf and 0.0 < order < np.inf):
        return np.full(samples, np.inf)
    with np.errstate(all="ignore"):
        left = -np.expm1(-order * np.log(ratio))  # 1 - r^-p cannot overflow
        bound = np.maximum.accumulate(SAFETY / left * distance(channel, coarse, fine))
    return bound if np.all(np.isfinite(bound)) else np.full(samples, np.inf)


def observed_order(steps: Sequence[float], wider: float, gap: float) -> float | None:
    """Order p from three steps and the two differences; None if there is none between 0 and LARGEST_ORDER."""
    if not all(0.0 < number < np.inf for number in (*steps, wider, gap)):
        return None
    first, second = steps[0] / steps[1], steps[1] / steps[2]
    if not (1.0 < first <= LARGEST_RATIO and 1.0 < second <= LARGEST_RATIO):
        return None

    def mismatch(order: float) -> float:
        return float(np.expm1(order * np.log(first)) / -np.expm1(-order * np.log(second))) - wider / gap

    low, high = 1e-3, LARGEST_ORDER
    if not mismatch(low) < 0.0 < mismatch(high) < np.inf:
        return None
    from scipy.optimize import brentq  # imported here because it is slow to import

    return float(brentq(mismatch, low, high))


Bound = tuple[float, Real, str, float | None]
"""Factor, the difference (T,) it applies to, an explanation, and the observed order if there is one."""


def _unproven(gaps: Sequence[Real], why: str) -> Bound:
    return UNPROVEN_SAFETY, np.maximum(*gaps[-2:]), f"3 x the larger difference: {why}", None


def _by_steps(rungs: Sequence[RungSignal], gaps: Sequence[Real]) -> Bound:
    """The bound from the last three of at least three fixed steps."""
    steps = [rung.effort for rung in rungs[-3:]]
    order = observed_order(steps, *(float(np.max(gap)) for gap in gaps[-2:]))
    if order is None or order < 1.0 - ORDER_BAND:
        return _unproven(gaps, "the runs do not converge yet")
    ratio = steps[1] / steps[2]
    if abs(order - round(order)) > ORDER_BAND:
        how = f"difference of the two finest steps, as order {order:.2f} is not whole"
        return SAFETY / (ratio - 1.0), gaps[-1], how, order
    credited = min(order, ORDER_CREDIT)
    how = f"Richardson, observed order {order:.2f}"
    return SAFETY / float(np.expm1(credited * np.log(ratio))), gaps[-1], how, order


def _by_tolerances(rungs: Sequence[RungSignal], gaps: Sequence[Real]) -> Bound:
    """The bound from the last three or four of at least three tolerances."""
    sizes = [float(np.max(gap)) for gap in gaps]
    if sizes[-2] < 2.0 * sizes[-1]:
        return _unproven(gaps, "the runs do not converge yet")
    work = [rung.evaluations for rung in rungs[-RUNGS:]]
    growth = [fine / coarse if coarse > 0 else np.nan for coarse, fine in pairwise(work)]
    if any(more <= NO_GROWTH for more in growth[-2:]):
        why = "as a finer one took hardly more evaluations"
        how = f"{UNCONTROLLED_SAFETY:g} x the difference of the two finest tolerances, {why}"
        return UNCONTROLLED_SAFETY, gaps[-1], how, None
    seen = sizes[-2] / sizes[-1] if sizes[-1] > 0.0 else np.inf
    before, ratio = (coarse.effort / fine.effort for coarse, fine in pairwise(rungs[-3:]))
    factor = max(1.0, _after_scatter(min(seen, ratio)))
    if growth[-1] <= growth[-2] ** (EXCESS_GROWTH * np.log(ratio) / np.log(before)):
        factor = min(factor, _after_scatter(_expected_decrease(sizes, growth)))
    return factor, gaps[-1], f"{factor:.2g} x the difference of the two finest tolerances", None


def _expected_decrease(sizes: Sequence[float], growth: Sequence[float]) -> float:
    """The factor by which the error is expected to decrease at the last effort; 1 if no order is observed.

    `sizes` are those of the differences; `growth` are the ratios of the evaluations of successive efforts, the last one
    for the finest effort.
    """
    falls = [wide / near if near > 0.0 else np.inf for wide, near in pairwise(sizes)]
    orders = [
        float(np.log(fall) / np.log(more)) if fall > 1.0 and more > 1.0 else np.inf
        for fall, more in zip(falls, growth, strict=False)
    ]
    if len(orders) < 2 or not max(orders) <= min(LARGEST_ORDER_IN_WORK, SAME_ORDER * min(orders)):
        return 1.0
    return min(falls[-1], float(growth[-1] ** orders[-1]))


def _after_scatter(fall: float) -> float:
    """Bound of e_3 / d_23, if e_3 is at most SCATTER/fall times e_2 <= d_23 + e_3."""
    return UNPROVEN_SAFETY if fall <= SCATTER else min(UNPROVEN_SAFETY, SCATTER / (fall - SCATTER))
