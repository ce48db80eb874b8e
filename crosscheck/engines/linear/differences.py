"""Derivatives by central differences of fourth order, with two steps.

    D(h) = [8 (f(h) - f(-h)) - (f(2h) - f(-2h))] / (12 h) = f' + C h^4 + ...

The result is D(h). Its error is estimated as |D(h) - D(2h)|, fifteen times the leading term, plus the rounding
1.5 noise / h of its own formula, where `noise` is that of the values of f.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flexmb.typing import Real

STEP = 1e-3
"""In SI units: the fourth power is 1e-12, and rounding divided by it 1e-13, of values whose scales are of order one."""


def differentiated(f: Callable[[Real], Real], size: int, noise: float, step: float = STEP) -> tuple[Real, float]:
    """The derivative (m, size) of f: (size,) -> (m,) at zero, and its error in the Frobenius norm."""
    fine, coarse = [], []
    for direction in np.eye(size):
        near, mid, far = (f(k * step * direction) - f(-k * step * direction) for k in (1.0, 2.0, 4.0))
        fine.append((8.0 * near - mid) / (12.0 * step))
        coarse.append((8.0 * mid - far) / (24.0 * step))
    gap = float(np.linalg.norm(np.array(fine) - np.array(coarse)))
    return np.array(fine).T, gap + 1.5 * noise * np.sqrt(size) / step
