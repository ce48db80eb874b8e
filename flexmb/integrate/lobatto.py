"""Lobatto's rule of order 6 over a unit: nodes at both ends, of weight 1/12, and at `INNER` from either, of 5/12."""

import math

INNER = 0.5 - math.sqrt(0.05)
EDGE_WEIGHT, INNER_WEIGHT = 1.0 / 12.0, 5.0 / 12.0
