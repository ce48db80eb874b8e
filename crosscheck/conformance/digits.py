"""Numbers in messages, with as many digits as tell them apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

LEAST, MOST = 3, 17  # significant digits; 17 tell any two floating-point numbers apart


def told_apart(first: ArrayLike, second: ArrayLike, allowed: ArrayLike = 0.0) -> tuple[str, str]:
    """Both in the same number of significant digits, from three: the least that shows every difference of components
    by more than `allowed`.

    Of arrays of different shapes each has three.
    """
    a, b = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    if a.shape != b.shape:
        return _shown(a, LEAST), _shown(b, LEAST)
    differ = ~(np.abs(a - b) <= allowed) & ~(np.isnan(a) & np.isnan(b))
    pairs = [(float(x), float(y)) for x, y in zip(a[differ].flat, b[differ].flat, strict=True)]
    digits = next((n for n in range(LEAST, MOST) if all(f"{x:.{n}g}" != f"{y:.{n}g}" for x, y in pairs)), MOST)
    return _shown(a, digits), _shown(b, digits)


def _shown(values: np.ndarray, digits: int) -> str:
    text = [f"{float(each):.{digits}g}" for each in values.flat]
    return f"[{' '.join(text)}]" if values.ndim else text[0]
