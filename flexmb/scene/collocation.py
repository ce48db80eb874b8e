"""Collocation at Gauss points: integrals of the polynomial through values at them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from flexmb.typing import Real


@lru_cache(maxsize=256)
def gauss_rule(points: int) -> tuple[Real, Real]:
    """Nodes and weights (points,) of Gauss's rule on [-1, 1], read-only."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    nodes.flags.writeable = weights.flags.writeable = False
    return nodes, weights


@lru_cache(maxsize=256)
def _coefficients(points: int) -> Real:
    """(points,points), read-only: Legendre's coefficients of the polynomial through values at the Gauss points."""
    coefficients = np.asarray(np.linalg.inv(np.polynomial.legendre.legvander(gauss_rule(points)[0], points - 1)), float)
    coefficients.flags.writeable = False
    return coefficients


def partial_integrals(xi: Real, points: int) -> Real:
    """(n, points): the integrals from -1 to xi (n,) of Lagrange's polynomials on the Gauss points of [-1, 1]."""
    values = np.polynomial.legendre.legvander(np.asarray(xi, float), points)
    # int_-1^xi P_n = (P_n+1 - P_n-1) / (2 n + 1), and xi + 1 for n = 0
    integrals = np.empty((len(values), points))
    integrals[:, 0] = values[:, 1] + 1.0
    integrals[:, 1:] = (values[:, 2:] - values[:, :-2]) / (2.0 * np.arange(1, points) + 1.0)
    return np.asarray(integrals @ _coefficients(points))
