"""The inertia of a beam: stations along the axis (Gauss points or element nodes) and rigid lumps.

The finite-element mass matrix and the inertia points of the equations of motion are sums over the same stations, so
that they agree to round-off.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import assert_never

import numpy as np

from flexmb.modal.interpolation import ElementMesh
from flexmb.modal.section import SectionTable
from flexmb.scene.bodies import BeamBody
from flexmb.scene.collocation import gauss_rule
from flexmb.scene.sections import inertia_matrices, mass_centres
from flexmb.typing import Real

GAUSS_POINTS = 6
"""Exact to degree 11: quintic deflections squared times a linearly varying section."""


@dataclass(frozen=True)
class Stations:
    """Inertia of sections: positions x (n,) m of their axis points and mass (n,) kg; mass centre (n,3) m from the axis
    point and inertia (n,3,3) kg m^2 about the mass centre.

    `plain`: all mass centres are on the axis, and the inertias are diagonal. twist (n,) kg m^2: inertia of the twist of
    sections that have none about the axis.
    """

    x: Real
    mass: Real
    com: Real
    inertia: Real
    plain: bool
    twist: Real

    def about(self, axis: int) -> Real:
        """Moments of inertia (n,) kg m^2 about an axis through the mass centre: 0, 1, 2 for x, y, z."""
        return self.inertia[:, axis, axis]

    def matrices(self) -> Real:
        """Mass matrices (n,6,6) for [displacement; rotation] of the axis points."""
        matrices: Real = inertia_matrices(self.mass, self.com, self.inertia)
        matrices[:, 3, 3] += self.twist
        return matrices


@dataclass(frozen=True)
class Lump:
    """A rigid lump at x (m): mass kg, mass centre (3,) m from the axis point, inertia (3,3) kg m^2 about it."""

    x: float
    mass: float
    com: Real
    inertia: Real


def quadrature(mesh: ElementMesh, table: SectionTable, cuts: Sequence[float] | Real = ()) -> tuple[Real, Real]:
    """Gauss points and weights (n,) on each piece between nodes, stations and cuts: kinks cost no accuracy.

    Stations that are all alike make no kink, wherever the beam ends.
    """
    others = np.concatenate([() if table.uniform else table.x, cuts])
    inside = others[(others > mesh.nodes[0]) & (others < mesh.nodes[-1])]
    breaks = np.unique(np.concatenate([mesh.nodes, inside]))
    s, w = gauss_rule(GAUSS_POINTS)
    half = np.diff(breaks) / 2.0
    middle = breaks[:-1] + half
    return (middle[:, None] + half[:, None] * s).ravel(), (half[:, None] * w).ravel()


def inertia_stations(
    body: BeamBody, mesh: ElementMesh, table: SectionTable, cuts: Sequence[float] | Real = ()
) -> Stations:
    """The beam's own inertia: at the Gauss points ("consistent") or at the element nodes ("lumped").

    Lumped: each node receives the inertia weighted by its hat function. `points = "line"` omits the section's inertia
    about its mass centre. Stations without mass are left out. The intervals of the Gauss points end at the `cuts` (m).
    """
    x, weight = quadrature(mesh, table, cuts)
    inertia, twist = weight[:, None, None] * table.at(table.inertia, x), weight * table.at(table.twist, x)
    if body.mass == "lumped":
        inertia, twist = _lumped(mesh, x, inertia), _lumped(mesh, x, twist)
        x = mesh.nodes
    kept = inertia[:, 0, 0] > 0.0  # a point without mass would divide by zero in `section_points`
    return section_masses(x[kept], inertia[kept], twist[kept], body, table.plain)


def _lumped(mesh: ElementMesh, x: Real, values: Real) -> Real:
    """Values (n,...) at x (n,) shared between the nodes before and beyond: (nodes,...)."""
    element, xi, _ = mesh.locate(x)
    share = xi.reshape(-1, *[1] * (values.ndim - 1))
    near, far = np.zeros((2, len(mesh.nodes), *values.shape[1:]))
    np.add.at(near, element, values * (1.0 - share))
    np.add.at(far, element + 1, values * share)
    return near + far


def section_masses(x: Real, inertia: Real, twist: Real, body: BeamBody, plain: bool) -> Stations:
    """Mass centres and inertias about them from mass matrices (n,6,6) about the axis; twist (n,) as in `Stations`."""
    if plain:
        mass, com, about_com = inertia[:, 0, 0], np.zeros((len(x), 3)), inertia[:, 3:, 3:]
    else:
        mass, com, about_com = mass_centres(inertia)
    match body.points:
        case "line":
            about_com = np.zeros_like(about_com)
        case "section":  # the masses are in the plane of the section
            about_com[:, 0, 1:], about_com[:, 1:, 0] = 0.0, 0.0
        case "rotary":
            pass
        case _:
            assert_never(body.points)
    if plain or body.points == "section":
        about_com[:, 0, 0] = about_com[:, 1, 1] + about_com[:, 2, 2]
    return Stations(x, mass, com, about_com, plain, twist)


def lumps(body: BeamBody) -> tuple[Lump, ...]:
    """The tip masses of `body`. Raises ValueError for one without mass, or beyond the ends of the beam."""
    parts = []
    for tip in body.tip_masses:
        inertia = np.array(tip.inertia_kg_m2, dtype=float)
        place = f"beam '{body.name}': tip mass at x = {tip.x_m:g} m"
        if tip.mass_kg <= 0.0:
            raise ValueError(f"{place} needs mass_kg > 0, got {tip.mass_kg:g}")
        if not 0.0 <= tip.x_m <= body.length_m:
            raise ValueError(f"{place} is not on [0, {body.length_m:g}] m")
        parts.append(Lump(tip.x_m, tip.mass_kg, np.array(tip.com_m, dtype=float), inertia))
    return tuple(parts)
