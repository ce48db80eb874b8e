"""Elementary functions of real numbers, and of complex ones that carry a derivative in their imaginary part.

A kernel whose workspace is complex computes with x + i h x', h so small that h^2 is nothing beside 1: sums, products
and quotients then carry x' along exactly, as first-order Taylor arithmetic does, and so do these functions (complex
step: Squire & Trapp 1998). Comparisons in kernels look at real parts. Eight copies in lanes are a third kind of number.
"""

import math

from flexmb.jit import lane_functions
from flexmb.jit.kernel import by_number, helper


@helper
def _sqrt(x):
    r = math.sqrt(x.real)
    return complex(r, 0.5 * x.imag / r)


@helper
def _sin(x):
    return complex(math.sin(x.real), math.cos(x.real) * x.imag)


@helper
def _cos(x):
    return complex(math.cos(x.real), -math.sin(x.real) * x.imag)


@helper
def _atan2(y, x):
    r2 = x.real * x.real + y.real * y.real
    return complex(math.atan2(y.real, x.real), (x.real * y.imag - y.real * x.imag) / r2)


sqrt = by_number(math.sqrt, _sqrt)
sin = by_number(math.sin, _sin)
cos = by_number(math.cos, _cos)
atan2 = by_number(math.atan2, _atan2)


@helper
def _sincos(x):
    return sin(x), cos(x)


sincos = by_number(_sincos, _sincos, lane_functions.sincos)  # both, which lanes find together
