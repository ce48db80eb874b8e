"""Elementary functions of the numbers that kernels compute with: floats, eight copies in lanes, and duals.

Which of them is decided when a kernel is compiled, by the numbers that its workspace holds: see `flexmb.jit.lanes` and
`flexmb.jit.duals`. Comparisons in kernels look at real parts, `x.real`, which of a dual is the number without its
derivatives.
"""

from math import atan2, cos, sin, sqrt

from flexmb.jit import lane_functions  # noqa: F401  (what they are of lanes, and how `sincos` is compiled)
from flexmb.jit.lanes import sincos, sines

__all__ = ["atan2", "cos", "sin", "sincos", "sines", "sqrt"]
