"""Elementary functions of the numbers in kernels: floats, lanes (eight copies of a scene) and duals.

The type of the workspace's numbers decides at compile time which functions are meant: see `flexmb.jit.lanes` and
`flexmb.jit.duals`. Comparisons in kernels use the real part `x.real`, which for a dual is the value without its
derivatives.
"""

from math import atan2, cos, exp, sin, sqrt

from flexmb.jit import lane_functions  # noqa: F401  (what they are of lanes, and how `sincos` is compiled)
from flexmb.jit.lanes import sincos, sines

__all__ = ["atan2", "cos", "exp", "sin", "sincos", "sines", "sqrt"]
