"""What rounding leaves of numbers that cancel: a threshold of zero is measured by the numbers that it is made of."""

from __future__ import annotations

import numpy as np

ROUNDING = float(64 * np.finfo(float).eps)
"""What sums and products of a few numbers leave where they cancel, relative to the largest of these."""
