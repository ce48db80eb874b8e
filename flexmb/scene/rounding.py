"""What rounding leaves of numbers that cancel: a threshold of zero is measured by the numbers that it is made of."""

from __future__ import annotations

import numpy as np

ROUNDING = float(64 * np.finfo(float).eps)
"""What sums and products of a few numbers leave where they cancel, relative to the largest of these."""

PRINTED = 1e-9
"""How well matrices that are printed to ten digits are symmetric and fulfil what is an equality in exact numbers (the
triangle inequality of a flat body's inertia), relative to their largest element."""


def tensor_dust(mass: float, length: float) -> float:
    """What rounding leaves (kg m²) of terms m r² that cancel, for a mass (kg) and a length (m) of the problem."""
    return ROUNDING * abs(mass) * length**2
