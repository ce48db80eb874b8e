"""Derivatives by central differences of fourth order, with two steps.

Let D_2(h) = [f(h) - f(-h)] / 2h be the differences of second order. Those of fourth order are

    D(h) = [4 D_2(h) - D_2(2h)] / 3 = f' + C h^4 + ...

The result is D(h). Its error is estimated as |D(h) - D(2h)|, fifteen times the leading term, plus the rounding
1.5 noise / h of its own formula, where `noise` is that of the values of f.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexmb.typing import Real

STEP = 1e-3
"""h in SI units: the fourth power is 1e-12, and rounding divided by it 1e-13, of values whose scales are of order one.
"""


def differentiated(f: Callable[[Real], Real], size: int, noise: float) -> tuple[Real, float]:
    """The derivative (m, size) of f: (size,) -> (m,) at zero, and its error in the Frobenius norm."""
    found, gap = fourth_order(*(_second_order(f, size, factor * STEP) for factor in (1.0, 2.0, 4.0)))
    return found, gap + 1.5 * noise * np.sqrt(size) / STEP


def fourth_order(near: Real, mid: Real, far: Real) -> tuple[Real, float]:
    """D(h) from D_2(h), D_2(2h), D_2(4h), and |D(h) - D(2h)|."""
    fine, coarse = (4.0 * near - mid) / 3.0, (4.0 * mid - far) / 3.0
    return fine, float(np.linalg.norm(fine - coarse))


def _second_order(f: Callable[[Real], Real], size: int, step: float) -> Real:
    return np.array([(f(step * one) - f(-step * one)) / (2.0 * step) for one in np.eye(size)]).T
