"""The formulas of DOP853, for a single run and for eight at once: the arrays hold numbers, or SIMD lanes of them.

Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I (1993), II.5 and II.10.
"""

from __future__ import annotations

import math

from flexmb.integrate.dop853_tableau import E3, E5, STAGES, D
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import select

END = STAGES  # row of the tableau A with the weights of the result; k[END] is the slope there
ERROR_EXPONENT = 8.0  # the error estimate is O(h^8)


@helper
def weighted_sum(weights, count, k, i):
    """Sum over j < count of weights[j] k[j, i]."""
    total = weights[0] * k[0, i]
    for j in range(1, count):
        total += weights[j] * k[j, i]
    return total


@helper
def combine(y, h, weights, count, k, result):
    """result = y + h * sum over j < count of weights[j] k[j]; loops run along rows of k and skip zero weights."""
    n = y.shape[0]
    for i in range(n):
        result[i] = weights[0] * k[0, i]
    for j in range(1, count):
        a = weights[j]
        if a != 0.0:
            for i in range(n):
                result[i] += a * k[j, i]
    for i in range(n):
        result[i] = y[i] + h * result[i]


@helper
def error_sums(y, y_new, k, accuracy):
    """Sums of squares of the error estimates of order 5 and 3 over the tolerance, both for a step of length 1."""
    sum5, sum3 = 0.0, 0.0
    for i in range(accuracy.controlled):
        old, new = abs(y[i]), abs(y_new[i])
        scale = accuracy.atol + accuracy.rtol * select(new > old, new, old)
        error5 = weighted_sum(E5, E5.shape[0], k, i) / scale
        error3 = weighted_sum(E3, E3.shape[0], k, i) / scale
        sum5 += error5 * error5
        sum3 += error3 * error3
    return sum5, sum3


@helper
def error_norm(h, sum5, sum3, accuracy):
    """Hairer's combination of both estimates, relative to the tolerance, for one run: below 1 the step is accepted."""
    if sum5 == 0.0 and sum3 == 0.0:
        return 0.0
    return h * sum5 / math.sqrt((sum5 + 0.01 * sum3) * accuracy.controlled)


@helper
def interpolant(y, y_new, h, k, f):
    """Coefficients f (7,n) of the polynomial of degree 7 from y to y_new, once all slopes k of the step are known."""
    for i in range(y.shape[0]):
        change = y_new[i] - y[i]
        f[0, i] = change
        f[1, i] = h * k[0, i] - change
        f[2, i] = 2.0 * change - h * (k[END, i] + k[0, i])
        for row in range(4):
            f[3 + row, i] = h * weighted_sum(D[row], D.shape[1], k, i)


@helper
def interpolate(y, f, x, result):
    """result = y + x (f0 + (1-x) (f1 + x (f2 + (1-x) (f3 + ...)))): the state at the fraction x of the step."""
    for i in range(y.shape[0]):
        value = f[6, i] * x
        for row in range(5, -1, -1):
            value = (value + f[row, i]) * (x if row % 2 == 0 else 1.0 - x)
        result[i] = y[i] + value
