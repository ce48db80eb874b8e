"""By how much polynomials make a beam too stiff whose stiffness varies along it.

Under a moment at the tip, and under a force there, the curvature is the moment over the stiffness, m / K, and the
compliance is the integral of m^2 / K (Castigliano). Polynomials P along each piece have g' A^-1 g instead, with g the
integral of P m and A that of K P P': less, as they are the best of their kind in energy. Along a uniform beam both are
equal from two polynomials on.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import assert_never

import numpy as np

from flexmb.scene.bodies import BeamBody
from flexmb.scene.collocation import gauss_rule
from flexmb.scene.pieces import edges
from flexmb.scene.sections import ABOUT_Y, ABOUT_Z, EXTENSION, TWIST, stiffness_on_axis
from flexmb.scene.strains import Strain
from flexmb.typing import Real

_POINTS = 24
"""Gauss points of each part between stations and ends of pieces; along one of them K is linear."""


def too_stiff(body: BeamBody, strain: Strain, counts: range) -> Iterator[tuple[int, float]]:
    """Each number of polynomials of a strain, and the larger part of the deflections under a moment and under a force
    at the tip that they leave out; none of a beam that is uniform against this strain, and of shear."""
    row = _row(strain)
    if row is None:
        return
    x, K = (
        np.array(each) for each in zip(*((s.x_m, stiffness_on_axis(s)[row, row]) for s in body.stations), strict=True)
    )
    if np.ptp(K) == 0.0:
        return
    pieces = [_of_piece(x, K, left, right, body.length_m) for left, right in pairwise(edges(body).tolist())]
    exact = sum(np.sum(weight * loads**2 / stiffness, axis=1) for _, weight, stiffness, loads in pieces)
    for count in counts:
        found: Real = np.zeros(2)
        for xi, weight, stiffness, loads in pieces:
            P = np.polynomial.legendre.legvander(xi, count - 1)
            g = P.T @ (weight * loads).T
            found = found + np.sum(g * np.linalg.solve(P.T @ ((weight * stiffness)[:, None] * P), g), axis=0)
        yield count, float(np.max(1.0 - found / exact))


def _row(strain: Strain) -> int | None:
    match strain:
        case "torsion":
            return TWIST
        case "bending_y":
            return ABOUT_Z
        case "bending_z":
            return ABOUT_Y
        case "axial":
            return EXTENSION
        case "shear_y" | "shear_z":
            return None
        case _:
            assert_never(strain)


def _of_piece(x: Real, K: Real, left: float, right: float, length: float) -> tuple[Real, Real, Real, Real]:
    """Points (n,) of a piece in [-1, 1] and their weights (m), stiffnesses there, and moments (2,n) of a unit moment at
    the tip, and of a unit force over the length."""
    at, w = gauss_rule(_POINTS)
    points, weights, stiffness = list[Real](), list[Real](), list[Real]()
    for k, (start, stop) in enumerate(pairwise(x.tolist())):  # a step of the section is a part of no length
        a, b = max(start, left), min(stop, right)
        if a < b:
            own = 0.5 * (a + b) + 0.5 * (b - a) * at
            points.append(own)
            weights.append(0.5 * (b - a) * w)
            stiffness.append(K[k] + (K[k + 1] - K[k]) * (own - start) / (stop - start))
    along = np.concatenate(points)
    loads = np.array([np.ones_like(along), 1.0 - along / length])
    xi = (2.0 * along - left - right) / (right - left)
    return xi, np.concatenate(weights), np.concatenate(stiffness), loads
