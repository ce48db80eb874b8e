"""Formulas of the classical Runge-Kutta method, once for one run and for eight: arrays of numbers, or of lanes."""

from flexmb.jit.kernel import helper


@helper
def advance(y, h, slope, result):
    """result = y + h slope."""
    for i in range(y.shape[0]):
        result[i] = y[i] + h * slope[i]


@helper
def weigh(y, h, k, result):
    """result = y + h times the weighted mean of the four slopes k (4,n)."""
    for i in range(y.shape[0]):
        result[i] = y[i] + h / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
