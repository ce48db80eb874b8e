"""Derivatives of smooth functions to round-off, and the bound of that round-off: collocation at Chebyshev points.

Trefethen, Spectral Methods in MATLAB (2000), ch. 6. A component exp(i omega t) leaves a truncation error of about
2 (omega span / 2)^17 / 17! at 17 points: below 1e-19 as long as omega span < 1.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from flexmb.typing import Real
from tests.bounds import gamma

POINTS = 17
MIDDLE = POINTS // 2


def times(span: float) -> Real:
    """The points in [-span, span], the middle one 0."""
    x = np.cos(np.pi * np.arange(POINTS) / (POINTS - 1))
    x[MIDDLE] = 0.0
    return span * x


def matrix(span: float) -> Real:
    """D (17,17): derivatives of the interpolant at the points from its values there."""
    x = times(span)
    c = np.ones(POINTS)
    c[[0, -1]] = 2.0
    c *= (-1.0) ** np.arange(POINTS)
    gaps = x[:, None] - x + np.eye(POINTS)
    D = np.outer(c, 1.0 / c) / gaps
    return D - np.diag(np.sum(D, axis=1))


def at_zero(values: Real, span: float) -> tuple[Real, Real]:
    """First and second derivative at 0 of the values (17,...) at `times(span)`."""
    D = matrix(span)
    return np.tensordot(D[MIDDLE], values, 1), np.tensordot((D @ D)[MIDDLE], values, 1)


def rounding(span: float, order: int, size: ArrayLike, digits: float = 0.0) -> float:
    """Bound of the round-off in a derivative at 0 of values no larger than `size`, themselves good to `digits` of it.

    The smallest gap between points is 5 span / 17^2, so that the entries of D are good to gamma(17^2).
    """
    D = np.abs(matrix(span))
    rows = D[MIDDLE] if order == 1 else (D @ D)[MIDDLE]
    return float(np.sum(rows) * (gamma(POINTS**2) + digits) * np.max(np.abs(size)))


def along(f: Callable[[float], ArrayLike], span: float) -> Real:
    """Values (17,...) of f at the points."""
    return np.array([f(t) for t in times(span)], dtype=float)
