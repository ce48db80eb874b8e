"""Level linear: M_m and b_m of level full to first order in (eta, etadot), the order of Frisch's equations.

With s = s0 + L0 eta, J = J0 + E eta, the coupling [C; L] and the modal masses M_ff affine in eta likewise, and
B_n = -1/2 E_n, G_nk = 1/2 d2J/(deta_n deta_k):

    force    w x (w x s) + 2 w x (L0 etadot)
    torque   w x (J w) + sum_n etadot_n (E_n w + w x C0_n)
    modal    w.(B_n - sum_k eta_k G_nk) w + w.sum_k etadot_k (C1_kn - C1_nk)

These truncated equations do not follow from a kinetic energy: energy is conserved to first order only, and M_m is not
positive definite at all deformations. The rotary inertia of wheels is not truncated: it turns with the wheel's node
and is summed.
"""

from dataclasses import replace

import numpy as np

from flexmb.jit.kernel import helper, kernel
from flexmb.levels.level import FidelityLevel, InertiaTables, six, sixes
from flexmb.levels.summed_point import add_points
from flexmb.modal.first_order import FirstOrder, first_order
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import TurningPoints
from flexmb.spatial.inertia import rigid_inertia, store_inertia
from flexmb.spatial.rows import column6, column_sym
from flexmb.spatial.spatial_vector import store6
from flexmb.spatial.vector import add, axpy, cross, dot, scale, store3, sub, sym6, sym_axpy, sym_times, vec3
from flexmb.tables.arrays import SLOPE


@kernel
def inertia_and_bias(c, w, k):
    """The body's first-order tables at eta and etadot, then its wheels."""
    nm = c.body[k].modes
    omega = vec3(w.body[k].velocity, 0)
    body = c.body[k].rigid
    s = vec3(body, 1)
    j = sym6(body, 4)
    momentum = (0.0, 0.0, 0.0)  # L0 etadot
    swirl = (0.0, 0.0, 0.0)  # C0 etadot
    b = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum_n B_n etadot_n
    for n in range(nm):
        eta = w.eta[k, n]
        etad = w.etad[k, n]
        angular, linear = column6(c.mfr[k], n)
        gyration = column_sym(c.gyration[k], n)
        s = axpy(eta, linear, s)
        j = sym_axpy(-2.0 * eta, gyration, j)
        momentum = axpy(etad, linear, momentum)
        swirl = axpy(etad, angular, swirl)
        b = sym_axpy(etad, gyration, b)
        _mode(c, w, k, n, omega)
    store_inertia(w.body[k].inertia, 0, rigid_inertia(body[0], s, j))
    torque = sub(cross(omega, add(sym_times(j, omega), swirl)), scale(2.0, sym_times(b, omega)))
    store3(w.body[k].force, 0, torque)
    store3(w.body[k].force, 3, cross(omega, add(cross(omega, s), scale(2.0, momentum))))
    add_points(c, w, k)


@helper
def _mode(c, w, k, n, omega):
    """Coupling, modal masses and force of mode n."""
    row = c.body[k].slope
    changing = c.body[k].mass_slope
    angular, linear = column6(c.mfr[k], n)
    gyration = column_sym(c.gyration[k], n)
    coriolis = (0.0, 0.0, 0.0)
    for i in range(c.body[k].modes):
        eta = w.eta[k, i]
        slope = c.slope[row, n, i]
        angular = axpy(eta, vec3(slope.mfr, 0), angular)
        linear = axpy(eta, vec3(slope.mfr, 3), linear)
        gyration = sym_axpy(-eta, sym6(slope.gyration, 0), gyration)
        coriolis = axpy(w.etad[k, i], vec3(slope.coriolis, 0), coriolis)
        mass = c.mff[k, n, i]
        if changing >= 0:
            for l in range(c.body[k].modes):
                mass += w.eta[k, l] * c.mass_slope[changing, n, i, l]
        w.pff[k, n, i] = mass
    store6(w.pfr[k, n], 0, (angular, linear))
    w.zf[k, n] = dot(omega, add(sym_times(gyration, omega), coriolis))


def tables(model: FlexibleModel, wheels: int) -> InertiaTables:
    """Tables of first order in eta; the rotary inertia of wheels, which turns with their nodes, is summed."""
    points, rotors = _wheels_apart(model, wheels)
    i: FirstOrder = first_order(points)
    slope = np.zeros(i.M0.shape, SLOPE)
    by_mode = np.swapaxes(i.C1, 0, 1)
    slope["mfr"] = np.concatenate([by_mode, np.swapaxes(i.L1, 0, 1)], axis=2)
    slope["coriolis"] = by_mode - i.C1
    slope["gyration"] = sixes(i.G)
    mass_slope = np.moveaxis(i.M1, 0, 2) if np.any(i.M1) else None
    rigid = np.array([i.mass, *i.s0, *six(i.J0)])
    mfr, gyration = np.hstack([i.C0, i.L0]).T, -0.5 * sixes(i.E).T
    return InertiaTables(rigid, i.M0, mfr, gyration, rotors, slope=slope, mass_slope=mass_slope)


def _wheels_apart(model: FlexibleModel, wheels: int) -> tuple[FlexibleModel, TurningPoints]:
    """The model with its wheels as point masses, and their rotary inertia as points without mass."""
    first = len(model.mass) - wheels
    inertia = model.inertia.copy()
    inertia[first:] = 0.0
    rotors = TurningPoints(
        mass=np.zeros(wheels),
        position=model.position[first:],
        com_offset=model.com_offset[first:],
        inertia=model.inertia[first:],
        translation=model.translation[first:],
        rotation=model.rotation[first:],
    )
    return replace(model, inertia=inertia), rotors


LEVEL = FidelityLevel(
    name="linear",
    inertia_and_bias=inertia_and_bias,
    without_masses=inertia_and_bias,
    tables=tables,
    cost=1.25,
)
