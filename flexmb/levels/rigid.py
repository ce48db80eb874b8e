"""Level rigid: no modes. T = 1/2 m v.v + v.(w x s) + 1/2 w.J w."""

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.levels.level import FidelityLevel, InertiaTables, six, sixes
from flexmb.modal.first_order import inertia_slope
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import modal_integrals
from flexmb.spatial.inertia import rigid_inertia, store_inertia
from flexmb.spatial.vector import cross, store3, sym6, sym_times, vec3


@helper
def inertia_and_bias(c, w, k):
    """Newton-Euler about the body origin."""
    body = c.body[k].rigid
    store_inertia(w.body[k].inertia, 0, rigid_inertia(body[0], vec3(body, 1), sym6(body, 4)))
    bias(c, w, k)


@helper
def bias(c, w, k):
    """Torque w x J w, force w x (w x s)."""
    body = c.body[k].rigid
    s = vec3(body, 1)
    j = sym6(body, 4)
    omega = vec3(w.body[k].velocity, 0)
    store3(w.body[k].force, 0, cross(omega, sym_times(j, omega)))
    store3(w.body[k].force, 3, cross(omega, cross(omega, s)))


def tables(model: FlexibleModel, wheels: int) -> InertiaTables:
    """Tables of the undeformed body."""
    integrals = modal_integrals(model)
    n, block = integrals.mode_count, integrals.spatial_mass
    rr = block[n:, n:]
    rigid = np.array([rr[5, 5], rr[2, 4], rr[0, 5], rr[1, 3], *six(rr[:3, :3])])
    return InertiaTables(rigid, block[:n, :n], block[n:, :n], -0.5 * sixes(inertia_slope(model)).T)


LEVEL = FidelityLevel(
    name="rigid",
    inertia_and_bias=inertia_and_bias,
    without_masses=inertia_and_bias,
    tables=tables,
    cost=1.0,
    flexible=False,
)
