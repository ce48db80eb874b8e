"""Derivatives by central differences of fourth order, with two steps.

Let D_2(h) = [f(h) - f(-h)] / 2h be the differences of second order. Those of fourth order are

    D(h) = [4 D_2(h) - D_2(2h)] / 3 = f' + C h^4 + ...

The result is D(h). Its error is estimated as |D(h) - D(2h)|, fifteen times the leading term, plus the rounding
1.5 noise / h of its own formula, where `noise` is that of the values of f. Where the former is more than the latter a
shorter step is tried, and the result with the least error is taken.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from flexmb.typing import Real

STEPS = (1e-3, 1e-4, 1e-5)
"""h in SI units. The fourth power of the first is 1e-12, and rounding divided by it 1e-13, of values whose scales are
of order one; shorter ones are for coordinates in which f bends more, such as those of high modes."""


def differentiated(f: Callable[[Real], Real], size: int, noise: float) -> tuple[Real, float]:
    """The derivative (m, size) of f: (size,) -> (m,) at zero, and its error in the Frobenius norm."""

    @cache
    def second_order(step: float) -> Real:
        return np.array([(f(step * one) - f(-step * one)) / (2.0 * step) for one in np.eye(size)]).T

    return fourth_order(second_order, noise * np.sqrt(size))


def fourth_order(second_order: Callable[[float], Real], noise: float) -> tuple[Real, float]:
    """D and its error from D_2 as a function of its step; `noise` is that of the values in the norm of D."""
    best, least = np.zeros(0), np.inf
    for step in STEPS:
        near, mid, far = (second_order(factor * step) for factor in (1.0, 2.0, 4.0))
        fine, coarse = (4.0 * near - mid) / 3.0, (4.0 * mid - far) / 3.0
        bent, rounding = float(np.linalg.norm(fine - coarse)), 1.5 * noise / step
        if not best.size or bent + rounding < least:
            best, least = fine, bent + rounding
        if not bent > rounding:
            break
    return best, least
