"""Collocation at Gauss points: integrals of the polynomial through values at them."""

from __future__ import annotations

import numpy as np

from flexmb.typing import Real


def partial_integrals(xi: Real, points: int) -> Real:
    """(n, points): the integrals from -1 to xi (n,) of Lagrange's polynomials on the Gauss points of [-1, 1]."""
    nodes, _ = np.polynomial.legendre.leggauss(points)
    coefficients = np.linalg.inv(np.polynomial.legendre.legvander(nodes, points - 1))
    values = np.polynomial.legendre.legvander(np.asarray(xi, float), points)
    # int_-1^xi P_n = (P_n+1 - P_n-1) / (2 n + 1), and xi + 1 for n = 0
    integrals = np.empty((len(values), points))
    integrals[:, 0] = values[:, 1] + 1.0
    for n in range(1, points):
        integrals[:, n] = (values[:, n + 1] - values[:, n - 1]) / (2 * n + 1)
    return np.asarray(integrals @ coefficients)
