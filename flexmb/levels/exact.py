"""Level exact: a beam whose strains are sums of modes; its kinematics are exact at any rotation.

The strain energy is 1/2 eta' K eta with constant K, and the kinetic energy the sum over inertia points that are fixed
to the sections (`flexmb.levels.section_motion`), which must have been moved. Nothing is truncated.
"""

from dataclasses import replace

import numpy as np

from flexmb.jit.kernel import kernel
from flexmb.levels import full
from flexmb.levels.level import FidelityLevel, InertiaTables, six
from flexmb.levels.masses import modal_masses
from flexmb.levels.summed_point import add_points, clear_inertia
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import TurningPoints, modal_integrals
from flexmb.typing import Real


@kernel
def inertia_and_bias(c, w, k):
    """The sum over all points of body k, after modal masses that are zero unless a matrix was added to them."""
    modal_masses(c, w, k)
    clear_inertia(c, w, k)
    add_points(c, w, k)


def tables(model: FlexibleModel, wheels: int) -> InertiaTables:
    """Every point is summed, and there are no other modal masses; the tables have the rigid inertia at rest."""
    i = modal_integrals(model)
    m = i.mode_count
    at_rest = full.polynomial(i, model)
    summed = TurningPoints(
        mass=model.mass,
        position=model.position,
        com_offset=model.com_offset,
        inertia=model.inertia,
        translation=model.translation,
        rotation=model.rotation,
        section=model.section,
    )
    at_rest = replace(at_rest, rigid=_rigid(i.spatial_mass[m:, m:]), mff=np.zeros((m, m)), mfr=i.spatial_mass[m:, :m])
    return replace(at_rest, product=None, summed=summed)


def _rigid(inertia: Real) -> Real:
    """(10,) mass, first moment and inertia of a spatial inertia (6,6), angular first; also of masses off their points,
    which the integrals of level full leave out."""
    moment = inertia[[2, 0, 1], [4, 5, 3]]  # of m c~
    return np.array([inertia[3, 3], *moment, *six(inertia[:3, :3])])


LEVEL = FidelityLevel(
    name="exact",
    inertia_and_bias=inertia_and_bias,
    without_masses=inertia_and_bias,
    tables=tables,
    cost=2.5,
    by_strain=True,
)
