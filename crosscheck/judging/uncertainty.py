"""Numerical uncertainty of one engine's result, from its own runs at successive efforts.

Let f_1, f_2, f_3 be the results at the last three efforts, coarse to fine, and d_12 = max |f_1 - f_2|, d_23 likewise.

**Fixed step** h_1 > h_2 > h_3. If f(h) = f + C h^p with r_12 = h_1/h_2 and r_23 = h_2/h_3, then

    d_12 / d_23 = r_23^p (r_12^p - 1) / (r_23^p - 1),         |f_3 - f| = d_23 / (r_23^p - 1).

The first equation gives the observed order p (for equal ratios p = log(d_12/d_23) / log r); the second, Richardson's
estimate, gives U with the safety factor 1.25 of the grid convergence index for three grids (Roache 1998). It is used
where p is within `ORDER_BAND` of a whole number: all one-step and multistep methods have whole orders, so a p that is
not is a sign of being outside the asymptotic range. No credit is given for more than order `ORDER_CREDIT`.
Outside the band but with p at least 1 - ORDER_BAND, the method is taken to be of order 1: U = 1.25 d_23/(r_23 - 1).
With a smaller p the runs have not begun to converge, or have reached round-off: U = 3 max(d_12, d_23), with the factor
of the grid convergence index for an unproven order.

**Tolerance.** Error is not a power of the tolerance, but it falls. If the finest error is at most half the one before,
|f_2 - f_3| >= e_2 - e_3 >= e_3: the difference bounds the error. d_12 >= 2 d_23 is the sign of it; without it
U = 3 max(d_12, d_23) again. How far an error falls scatters: at a finer tolerance it is at most a spread S times what
the fall q foretells, e_3 <= S/q e_2. With e_2 <= d_23 + e_3, that is

    U = S/(q - S) d_23,        at most 3 d_23.

At q the lesser of d_12 / d_23 and the tolerances' ratio, S is `SPREAD`. U is at least d_23, because errors may have
stopped to fall and the differences do not show it. The evaluations N show it, if they are counted. Where they grow by
no more than `HARDLY_MORE`, something else rules the steps (stability, the samples, a leap): U = `UNRULED` d_23. Else
p = log(d_12 / d_23) / log(N_2 / N_1) is the order in the mean step. One p may be chance, as errors at the kinks of a
stop are; four efforts tell it twice. Where both agree within a factor of `SAME_ORDER`, and neither is beyond
`LARGEST_ORDER_IN_WORK`, which no method has, errors fall evenly: U may be less than d_23, q being the least of
d_12 / d_23 and (N_3 / N_2)^p. Not so where evaluations grow much more than before, beside the tolerance, in
logarithms by `MUCH_MORE`: error control fights round-off that the scene magnifies. The spreads are those of the
library, see docs/verdicts.md.

**Round-off.** N evaluations, each with relative rounding errors of size eps and random sign, add up to about
eps sqrt(N) times the size of the signal (Henrici 1962); a systematic growth beyond that shows in the differences. The
size is that of the largest signal of the same family (all hinge torques, all positions): a backward-stable solve leaves
errors relative to the norm of everything it solves for.

Estimating is total: whatever is no ladder of finite runs at falling efforts gives an infinite U with the reason, and a
comparison with it is unresolved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from flexmb.run.channels import distance
from flexmb.typing import Real

SAFETY = 1.25
UNPROVEN_SAFETY = 3.0
MOST_COUNTED = 2**63  # evaluations: a record may hold any whole number, and larger ones are no numbers of NumPy
RUNGS = 4  # of a ladder that can count
ORDER_BAND = 0.1
SPREAD = 10.0
UNRULED = 15.0
SAME_ORDER = 1.25
LARGEST_ORDER_IN_WORK = 12.0
HARDLY_MORE = 1.03  # evaluations at the finer of two tolerances, over those at the coarser
MUCH_MORE = 1.5  # their growth's logarithm, over that foretold by the growth before
ORDER_CREDIT = 4.0
LARGEST_ORDER = 16.0
LARGEST_RATIO = 1e6  # of two steps: an order seen across more is seen nowhere


@dataclass(frozen=True)
class Uncertainty:
    """U of one channel of one result: `envelope` (T,), never falling; `value`, its maximum; how it was found."""

    envelope: Real
    value: float
    how: str
    order: float | None = None


@dataclass(frozen=True)
class RungSignal:
    """One run of a ladder in one channel: the effort's step (s) or relative tolerance, and the signal (T, k).

    `evaluations`: the number of right-hand sides, 0 if not counted.
    """

    effort: float
    values: Real
    evaluations: int = 0


def unknown(samples: int, why: str) -> Uncertainty:
    """An infinite U: nothing is known, for the reason `why`."""
    return Uncertainty(np.full(samples, np.inf), float("inf"), f"unknown: {why}")


def estimate(channel: str, kind: str, rungs: Sequence[RungSignal], size: float) -> Uncertainty:
    """U of the finest of `rungs` (coarse to fine, all of one method; `kind` is "step" or "tolerance").

    The last three count, of tolerances the last four. `size` is the magnitude of the signal's family. Never raises: U
    is infinite where the rungs say nothing.
    """
    samples = len(rungs[-1].values) if rungs else 0
    fault = _fault(kind, rungs, size)
    if fault:
        return unknown(samples, fault)
    floor = roundoff_floor(size, max(rungs[-1].evaluations, samples))
    gaps = [distance(channel, coarse.values, fine.values) for coarse, fine in pairwise(rungs[-RUNGS:])]
    if len(gaps) == 1:
        return _enveloped(UNPROVEN_SAFETY, gaps[0], floor, "3 x the difference of the only two efforts", None)
    factor, gap, how, order = _by_tolerances(rungs, gaps) if kind == "tolerance" else _by_steps(rungs, gaps)
    return _enveloped(factor, gap, floor, how, order)


def _fault(kind: str, rungs: Sequence[RungSignal], size: float) -> str:
    """Why nothing can be said from such runs; "" if something can."""
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
        count = next((each for each in evaluations if not 0 <= each < np.inf), evaluations[-1])
        return f"{count} evaluations of a signal of size {size:g} leave no round-off to be told"
    return ""


def _enveloped(factor: float, gap: Real, floor: float, how: str, order: float | None) -> Uncertainty:
    """U that never falls over time, above the round-off."""
    with np.errstate(over="ignore"):
        envelope = np.maximum.accumulate(factor * gap) + floor
    if not np.all(np.isfinite(envelope)):
        return unknown(len(envelope), "the runs are so far apart that their distance is no number")
    return Uncertainty(envelope, float(envelope[-1]), how, order)


def roundoff_floor(size: float, evaluations: int) -> float:
    """eps sqrt(N) times the size of the signals."""
    return float(np.finfo(np.float64).eps * np.sqrt(float(min(evaluations, MOST_COUNTED))) * size)


def spatial(channel: str, coarse: Real, fine: Real, ratio: float, order: float) -> Real:
    """U (T,) of a spatial discretisation, for its *coarse* result: f_c - f = (f_c - f_f) r^p / (r^p - 1), safety 1.25.

    `order` is the known order p of the discretisation and `ratio` r its refinement. Infinite where they say nothing:
    results of different shapes or with values that are no numbers, a ratio that is none, no order.
    """
    samples = len(coarse)
    comparable = coarse.shape == fine.shape and coarse.size > 0 and np.all(np.isfinite((coarse, fine)))
    if not (comparable and 1.0 < ratio < np.inf and 0.0 < order < np.inf):
        return np.full(samples, np.inf)
    with np.errstate(all="ignore"):
        left = -np.expm1(-order * np.log(ratio))  # 1 - r^-p, which no r^p can overflow
        found = np.maximum.accumulate(SAFETY / left * distance(channel, coarse, fine))
    return found if np.all(np.isfinite(found)) else np.full(samples, np.inf)


def observed_order(steps: Sequence[float], wider: float, gap: float) -> float | None:
    """Order p from three steps and the two differences; None where there is none between 0 and LARGEST_ORDER."""
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
    return float(brentq(mismatch, low, high))


Bound = tuple[float, Real, str, float | None]
"""Factor, the difference (T,) it applies to, an explanation, and the observed order if there is one."""


def _unproven(gaps: Sequence[Real], why: str) -> Bound:
    return UNPROVEN_SAFETY, np.maximum(*gaps[-2:]), f"3 x the larger difference: {why}", None


def _by_steps(rungs: Sequence[RungSignal], gaps: Sequence[Real]) -> Bound:
    """Of at least three fixed steps, by the last three."""
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
    """Of at least three tolerances, by the last three or four."""
    sizes = [float(np.max(gap)) for gap in gaps]
    if sizes[-2] < 2.0 * sizes[-1]:
        return _unproven(gaps, "the runs do not converge yet")
    work = [rung.evaluations for rung in rungs[-RUNGS:]]
    growth = [fine / coarse if coarse > 0 else np.nan for coarse, fine in pairwise(work)]
    if any(more <= HARDLY_MORE for more in growth[-2:]):
        why = "as a finer one took hardly more evaluations"
        return UNRULED, gaps[-1], f"{UNRULED:g} x the difference of the two finest tolerances, {why}", None
    seen = sizes[-2] / sizes[-1] if sizes[-1] > 0.0 else np.inf
    before, ratio = (coarse.effort / fine.effort for coarse, fine in pairwise(rungs[-3:]))
    factor = max(1.0, _after_scatter(min(seen, ratio)))
    if growth[-1] <= growth[-2] ** (MUCH_MORE * np.log(ratio) / np.log(before)):
        factor = min(factor, _after_scatter(_foretold(sizes, growth)))
    return factor, gaps[-1], f"{factor:.2g} x the difference of the two finest tolerances", None


def _foretold(sizes: Sequence[float], growth: Sequence[float]) -> float:
    """How far evaluations foretell that the error falls at the last effort; 1, not at all, where they tell no order.

    `sizes` of the differences, `growth` of the evaluations, which leads from each difference to the next; its last one
    leads to the finest effort.
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
    """Bound of e_3 over d_23, if e_3 is at most SPREAD/fall times e_2 <= d_23 + e_3."""
    return UNPROVEN_SAFETY if fall <= SPREAD else min(UNPROVEN_SAFETY, SPREAD / (fall - SPREAD))
