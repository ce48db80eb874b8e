"""Level stiffened: level full with a second-order field, displacements phi eta + 1/2 eta' G eta.

The kinetic energy is the sum over inertia points with this motion. Nothing is truncated, so that it is positive.
Centrifugal, gyroscopic and gravity stiffness follow from it. The velocity of a point is

    v + w x rho + sum_n (phi_n + (G eta)_n) etadot_n

and its acceleration at wdot = vdot = etaddot = 0 is w x (w x rho) + 2 w x rho' + etadot' G etadot. The inertia points
are few equivalent masses (`flexmb.modal.equivalent`).
"""

from dataclasses import replace

import numpy as np

from flexmb.jit.kernel import helper, kernel
from flexmb.levels import full
from flexmb.levels.level import FidelityLevel, InertiaTables
from flexmb.levels.summed_point import add_point, complete_masses
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import modal_integrals, stacked, still_points
from flexmb.spatial.inertia import add_inertia, rigid_inertia, store_inertia
from flexmb.spatial.rows import column3, store_column3
from flexmb.spatial.spatial_vector import ZERO6, add6, store6
from flexmb.spatial.vector import add, add3, axpy, cross, dot, scale, store3, vec3


@kernel
def inertia_and_bias(c, w, k):
    """The sum over all points of body k."""
    zero = (0.0, 0.0, 0.0)
    store_inertia(w.body[k].inertia, 0, rigid_inertia(0.0, zero, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)))
    store3(w.body[k].force, 0, zero)
    store3(w.body[k].force, 3, zero)
    for n in range(c.body[k].modes):
        store6(w.pfr[k, n], 0, ZERO6)
        w.zf[k, n] = 0.0
        for i in range(c.body[k].modes):
            w.pff[k, n, i] = c.mff[k, n, i]
    for j in range(c.body[k].point_start, c.body[k].point_stop):
        if c.point[j].turning:
            add_point(c, w, k, j)
        else:
            _add_mass(c, w, k, j)
    complete_masses(c, w, k)


@helper
def _add_mass(c, w, k, j):
    """Add the point mass j to body k. It is in the table of modal masses at rest; here their change is added."""
    nm = c.body[k].modes
    omega = vec3(w.body[k].velocity, 0)
    mass = c.point[j].mass
    r, v, bend = _motion(c, w, k, j)
    s = scale(mass, r)
    steiner = (
        s[1] * r[1] + s[2] * r[2],
        s[0] * r[0] + s[2] * r[2],
        s[0] * r[0] + s[1] * r[1],
        -s[0] * r[1],
        -s[0] * r[2],
        -s[1] * r[2],
    )
    add_inertia(w.body[k].inertia, 0, rigid_inertia(mass, s, steiner))
    force = scale(mass, add(bend, cross(omega, add(cross(omega, r), scale(2.0, v)))))
    add3(w.body[k].force, 0, cross(r, force))
    add3(w.body[k].force, 3, force)
    for n in range(nm):
        ln = column3(w.point_mode, 3, n)
        add6(w.pfr[k, n], 0, (cross(s, ln), scale(mass, ln)))
        w.zf[k, n] += dot(ln, force)
        at_rest = column3(c.point_mode[j], 3, n)
        for i in range(nm):
            change = dot(ln, column3(w.point_mode, 3, i)) - dot(at_rest, column3(c.point_mode[j], 3, i))
            w.pff[k, n, i] += mass * change


@helper
def _motion(c, w, k, j):
    """Position, and relative to the body velocity and acceleration at etaddot = 0, of point j; L in w.point_mode."""
    second = c.second_shape[c.point[j].second]
    r = vec3(c.point[j].position, 0)
    v = (0.0, 0.0, 0.0)
    bend = (0.0, 0.0, 0.0)
    for n in range(c.body[k].modes):
        at_rest = column3(c.point_mode[j], 3, n)
        phi = at_rest
        rate = (0.0, 0.0, 0.0)
        for i in range(c.body[k].modes):
            G = vec3(second[n, i].translation, 0)
            phi = axpy(w.eta[k, i], G, phi)
            rate = axpy(w.etad[k, i], G, rate)
        r = axpy(0.5 * w.eta[k, n], add(at_rest, phi), r)
        v = axpy(w.etad[k, n], phi, v)
        bend = axpy(w.etad[k, n], rate, bend)
        store_column3(w.point_mode, 3, n, phi)
    return r, v, bend


def tables(model: FlexibleModel, wheels: int) -> InertiaTables:
    """Every mass, and every turning inertia, is a point to be summed; the tables have the modal masses at rest."""
    i = modal_integrals(model)
    masses = np.flatnonzero((model.mass > 0.0) & ~np.any(model.com_offset != 0.0, axis=1))
    return replace(full.polynomial(i, model), product=None, summed=stacked(still_points(model, masses), i.turning))


LEVEL = FidelityLevel(
    name="stiffened",
    inertia_and_bias=inertia_and_bias,
    without_masses=inertia_and_bias,
    tables=tables,
    cost=1.8,
    second_order=True,
)
