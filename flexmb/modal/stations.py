"""The inertia of a beam: stations along the axis (Gauss points or element nodes) and rigid lumps.

The finite-element mass matrix and the inertia points of the equations of motion are sums over the same stations, so
that they agree to round-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from flexmb.modal.interpolation import ElementMesh
from flexmb.modal.section import SectionTable
from flexmb.scene.bodies import BeamBody
from flexmb.typing import Real

GAUSS_POINTS = 6
"""Exact to degree 11: quintic deflections squared times a linearly varying section."""


@dataclass(frozen=True)
class Stations:
    """Inertia on the axis: position x (n,) m, mass (n,) kg, section inertia about y and z (n,) kg m^2.

    The inertia about x is the sum of the two.
    """

    x: Real
    mass: Real
    inertia_y: Real
    inertia_z: Real


@dataclass(frozen=True)
class Lump:
    """A rigid lump at x (m): mass kg, mass centre (3,) m from the axis point, inertia (3,3) kg m^2 about it."""

    x: float
    mass: float
    com: Real
    inertia: Real


def quadrature(mesh: ElementMesh, table: SectionTable, cuts: Sequence[float] | Real = ()) -> tuple[Real, Real]:
    """Gauss points and weights (n,) on each piece between nodes, stations and cuts: kinks cost no accuracy."""
    others = np.concatenate([table.x, cuts])
    inside = others[(others > mesh.nodes[0]) & (others < mesh.nodes[-1])]
    breaks = np.unique(np.concatenate([mesh.nodes, inside]))
    s, w = np.polynomial.legendre.leggauss(GAUSS_POINTS)
    half = np.diff(breaks) / 2.0
    middle = breaks[:-1] + half
    return (middle[:, None] + half[:, None] * s).ravel(), (half[:, None] * w).ravel()


def inertia_stations(
    body: BeamBody, mesh: ElementMesh, table: SectionTable, cuts: Sequence[float] | Real = ()
) -> Stations:
    """The beam's own inertia: at the Gauss points ("consistent") or at the element nodes ("lumped").

    Lumped: each node receives the inertia weighted by its hat function. `points = "line"` omits the section's inertia.
    Stations without mass are left out. The intervals of the Gauss points end at the `cuts` (m).
    """
    x, weight = quadrature(mesh, table, cuts)
    mass = weight * table.at(table.mass, x)
    inertia_y = weight * table.at(table.rotary_y, x)
    inertia_z = weight * table.at(table.rotary_z, x)
    if body.points == "line":
        inertia_y, inertia_z = np.zeros_like(x), np.zeros_like(x)
    if body.mass == "lumped":
        element, xi, _ = mesh.locate(x)
        x = mesh.nodes
        mass, inertia_y, inertia_z = (
            np.bincount(element, values * (1.0 - xi), len(x)) + np.bincount(element + 1, values * xi, len(x))
            for values in (mass, inertia_y, inertia_z)
        )
    kept = mass > 0.0  # a point without mass would divide by zero in `section_points`
    return Stations(x[kept], mass[kept], inertia_y[kept], inertia_z[kept])


def lumps(body: BeamBody) -> tuple[Lump, ...]:
    """The tip masses of `body`. Raises ValueError for one without mass, or beyond the ends of the beam."""
    found = []
    for tip in body.tip_masses:
        inertia = np.array(tip.inertia_kg_m2, dtype=float)
        place = f"beam '{body.name}': tip mass at x = {tip.x_m:g} m"
        if tip.mass_kg <= 0.0:
            raise ValueError(f"{place} needs mass_kg > 0, got {tip.mass_kg:g}")
        if not 0.0 <= tip.x_m <= body.length_m:
            raise ValueError(f"{place} is not on [0, {body.length_m:g}] m")
        found.append(Lump(tip.x_m, tip.mass_kg, np.array(tip.com_m, dtype=float), inertia))
    return tuple(found)
