"""A beam cut at some sections: the share of each inertia point beyond each cut, and how the sections move.

The quadrature of a beam of modes is split at the cuts, so that the interval of each inertia point lies on one side of
every cut. A beam of level exact keeps its Gauss points, of which an inertia force per length is the polynomial through
its values there: with the weights w_j and the integrals A_xj of Lagrange's polynomials up to x, its integral beyond x
is the sum of (1 - A_xj / w_j) times the force of each point. Either way, the inertia beyond the root is that of the
whole beam in the equations of motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.modal.beam import beam_elements
from flexmb.modal.element_points import Points, on_axis
from flexmb.modal.exact import BeamPoints, cut_beam
from flexmb.modal.flexible import points_of, second_order_of
from flexmb.modal.flexible_model import SecondOrder
from flexmb.modal.reduce import beam_modes
from flexmb.modal.section import section_table
from flexmb.modal.stations import inertia_stations, lumps
from flexmb.modal.strain_field import StrainField, gauss_weights
from flexmb.scene.bodies import BeamBody
from flexmb.scene.rest_curve import rest_sections
from flexmb.typing import Index, Real


@dataclass(frozen=True, eq=False)
class ByShapes:
    """Motion by mode shapes (n,3,m) of the points, and (X,6,m) [displacement; rotation] of the sections, with their
    second-order fields at level stiffened."""

    points: Points
    second: SecondOrder | None
    sections: Real
    second_sections: SecondOrder | None


@dataclass(frozen=True, eq=False)
class ByStrains:
    """Motion by the strains of a field; numbers of the sections of its points (n,) and of the cuts (X,), which are
    turned by `rotation` (X,3,3) from the root at rest."""

    field: StrainField
    points: Index
    cuts: Index
    rotation: Real


@dataclass(frozen=True, eq=False)
class BeamSections:
    """Cuts at x (X,) m of a beam, body frame.

    points: inertia points of the whole beam; `share` (X,n): of each beyond each cut. `motion`: how points and sections
    move. stiffness (X,6,6) about the axis, infinite where there is no shear; `plain` if it couples nothing.
    """

    x: Real
    points: Points | BeamPoints
    share: Real
    motion: ByShapes | ByStrains
    stiffness: Real
    plain: bool


def beam_sections(body: BeamBody, x: Real) -> BeamSections:
    """A beam with its modes (none at level rigid), cut at ascending x (X,) m."""
    points, share, motion = _by_strains(body, x) if body.level == "exact" else _by_shapes(body, x)
    table = section_table(body)
    stiffness = table.at(table.stiffness, x)
    return BeamSections(x=x, points=points, share=share, motion=motion, stiffness=stiffness, plain=table.plain)


def _by_shapes(body: BeamBody, x: Real) -> tuple[Points, Real, ByShapes]:
    elements = beam_elements(body)
    table, rigid_lumps = elements.table, lumps(body)
    stations = inertia_stations(body, elements.mesh, table)
    if body.level == "rigid":
        columns = np.zeros((elements.size, 0))
    else:
        columns = beam_modes(elements, elements.stiffness(), elements.mass(stations, rigid_lumps), body.modes).columns
    if body.mass == "consistent":  # no interval may contain a cut; the modes above stay those of the body in motion
        stations = inertia_stations(body, elements.mesh, table, cuts=x)
    points = points_of(body, elements, columns, stations, rigid_lumps)
    motion = ByShapes(
        points=points,
        second=second_order_of(body, elements, columns, points.x, points.position - on_axis(points.x)),
        sections=elements.motion(x, columns),
        second_sections=second_order_of(body, elements, columns, x, np.zeros((len(x), 3))),
    )
    return points, _beyond(x, points.x), motion


def _by_strains(body: BeamBody, x: Real) -> tuple[BeamPoints, Real, ByStrains]:
    field, points = cut_beam(body, x)
    _, weight = gauss_weights(body)
    cuts = len(field.x) - len(x) + np.arange(len(x))
    share = _beyond(x, field.x[points.section])
    share[:, : len(weight)] = 1.0 - field.weight[cuts] / weight
    return points, share, ByStrains(field, points.section, cuts, rest_sections(body, x)[1])


def _beyond(x: Real, points: Real) -> Real:
    """(X,n): 1 for points at or beyond the cuts, 0 for others."""
    return (points >= x[:, None]).astype(float)
