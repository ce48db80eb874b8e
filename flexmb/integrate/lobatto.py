"""Lobatto's rule of order 6 on a unit interval: both ends with weight 1/12, and `INNER` from either with 5/12."""

import math

INNER = 0.5 - math.sqrt(0.05)
EDGE_WEIGHT, INNER_WEIGHT = 1.0 / 12.0, 5.0 / 12.0
