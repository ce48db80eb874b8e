"""A beam cut at some sections: the inertia points beyond each cut, and the motion of the sections themselves.

The quadrature of the beam's inertia is split at the cuts, so that the interval of each inertia point lies on one side
of every cut. The inertia beyond the root is therefore that of the whole beam in the equations of motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexmb.modal.beam import beam_elements
from flexmb.modal.element_points import Points, on_axis
from flexmb.modal.flexible import points_of, second_order_of
from flexmb.modal.flexible_model import SecondOrder
from flexmb.modal.reduce import beam_modes
from flexmb.modal.stations import inertia_stations, lumps
from flexmb.scene.bodies import BeamBody
from flexmb.typing import Index, Real


@dataclass(frozen=True, eq=False)
class BeamSections:
    """Cuts at x (X,) m of a beam, body frame.

    points: inertia points of the whole beam, with no cut inside the interval of any; `beyond` (n,): the number of cuts
    that each is at or beyond; `second`: their second-order field at level stiffened. motion (X,6,m): mode shapes
    [displacement; rotation] of the sections, `second_motion` their field. stiffness (X,6,6) about the axis, infinite
    where there is no shear; `plain` if it couples nothing.
    """

    x: Real
    points: Points
    beyond: Index
    second: SecondOrder | None
    motion: Real
    second_motion: SecondOrder | None
    stiffness: Real
    plain: bool


def beam_sections(body: BeamBody, x: Real) -> BeamSections:
    """A beam with its modes (none at level rigid), cut at ascending x (X,) m."""
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
    return BeamSections(
        x=x,
        points=points,
        beyond=np.searchsorted(x, points.x, side="right"),
        second=second_order_of(body, elements, columns, points.x, points.position - on_axis(points.x)),
        motion=elements.motion(x, columns),
        second_motion=second_order_of(body, elements, columns, x, np.zeros((len(x), 3))),
        stiffness=table.at(table.stiffness, x),
        plain=table.plain,
    )
