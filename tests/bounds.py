"""Where every tolerance comes from.

Algebra is judged by backward error, never by a chosen relative tolerance: two routes to the same equations differ by
rounding, and rounding of a sum of n terms is at most gamma(n) times the sum of their magnitudes (Higham, Accuracy and
Stability of Numerical Algorithms, 2nd ed., sec. 3.1). Orders of convergence are read from the last slopes above the
round-off floor.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from flexmb.typing import Real

UNIT_ROUNDOFF = 2.0**-53


def gamma(n: int) -> float:
    """n u / (1 - n u): bound of the relative error of n roundings in a row."""
    return n * UNIT_ROUNDOFF / (1.0 - n * UNIT_ROUNDOFF)


def backward_error(M: ArrayLike, x: ArrayLike, b: ArrayLike, magnitude: ArrayLike | None = None) -> float:
    """max |M x - b| / (|M| |x| + magnitude), normwise: the relative change of the data that makes x exact.

    `magnitude` (default |b|) is the size of the terms that b was summed from: where they cancel, b itself says nothing.
    """
    M, x, b = np.asarray(M, dtype=float), np.asarray(x, dtype=float), np.asarray(b, dtype=float)
    size = np.abs(b) if magnitude is None else np.abs(np.asarray(magnitude, dtype=float))
    total = np.linalg.norm(M, np.inf) * np.linalg.norm(x, np.inf) + np.linalg.norm(size, np.inf)
    return float(np.linalg.norm(M @ x - b, np.inf) / total)


def algebra(speeds: int, depth: int, points: int = 1) -> float:
    """Backward error within which two routes to the same equations of motion agree.

    A result passes through the poses and velocities of at most `depth` bodies on the way out and their inertias on the
    way back, sums over `points` inertia points of a body, and a factorisation of at most `speeds` unknowns. Every step
    of a sweep rounds a spatial vector: six products of six terms each, in both routes.
    """
    return gamma(speeds + points + 2 * 36 * depth)


def observed_order(steps: ArrayLike, errors: ArrayLike, floor: float, last: int = 2) -> float:
    """Mean of the `last` slopes of log(error) over log(step) whose errors lie above ten times the round-off `floor`."""
    h, e = np.asarray(steps, dtype=float), np.asarray(errors, dtype=float)
    above = e > 10.0 * floor
    h, e = h[above], e[above]
    if len(h) < last + 1:
        raise ValueError(f"only {len(h)} errors lie above the round-off floor {floor:g}: take larger steps")
    slopes = np.diff(np.log(e)) / np.diff(np.log(h))
    return float(np.mean(slopes[-last:]))


def relative(a: ArrayLike, b: ArrayLike, scale: ArrayLike | None = None) -> float:
    """max |a - b| over the larger magnitude of both, or over `scale`'s where the terms are larger than their sum."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    sizes: Sequence[Real] = [a, b] if scale is None else [np.asarray(scale, dtype=float)]
    size = max(float(np.max(np.abs(x), initial=0.0)) for x in sizes)
    return float(np.max(np.abs(a - b), initial=0.0)) / size if size > 0.0 else 0.0
