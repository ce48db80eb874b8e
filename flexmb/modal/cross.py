"""Cross products as matrices."""

from __future__ import annotations

import numpy as np

from flexmb.typing import Real


def cross_matrix(a: Real) -> Real:
    """Cross-product matrices (..., 3, 3) of vectors (..., 3): cross_matrix(a) b = a x b."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
