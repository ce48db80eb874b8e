"""Level full: exact kinematics of the linear modal field; the kinetic energy is the sum over inertia points.

Point r = x + phi eta, point rotation exp(skew(psi eta)). Mass at the points themselves gives a kinetic energy that is
polynomial in eta: it is carried by the integrals P0_n = sum m phi_n x' and P1_ni = sum m phi_n phi_i', no sum over
points is left. Points with rotating inertia, or with a mass centre off the point, are summed.
"""

import numpy as np

from flexmb.jit.kernel import helper
from flexmb.levels.affine_integrals import AXIAL, NUMBERS, blocks_of_cross_products, sum_integrals, symmetric, vector
from flexmb.levels.level import FidelityLevel, InertiaTables, empty_tables, six
from flexmb.levels.masses import modal_masses
from flexmb.levels.summed_point import add_point
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import ModalIntegrals, modal_integrals
from flexmb.spatial.inertia import rigid_inertia, store_inertia
from flexmb.spatial.vector import (
    add,
    axpy,
    cross,
    dot,
    scale,
    store3,
    sub,
    sym6,
    sym_add,
    sym_axpy,
    sym_dot,
    sym_times,
    vec3,
)


@helper
def inertia_and_bias(c, w, k):
    """Modal masses, all else of the polynomial part, then the summed points."""
    modal_masses(c, w, k)
    coupling_and_bias(c, w, k)
    for j in range(c.body[k].point_start, c.body[k].point_stop):
        add_point(c, w, k, j)


@helper
def coupling_and_bias(c, w, k):
    """Integrals of r x (.) and phi_n . (.) of the point acceleration w x (w x r) + 2 w x (phi etadot)."""
    nm = c.body[k].modes
    at_rest, p = c.product[c.body[k].product], w.integral
    sum_integrals(at_rest, w.mode[k], nm, p)
    omega = vec3(w.body[k].velocity, 0)
    spin = centrifugal(omega)
    body = c.body[k].rigid
    s = vec3(body, 1)
    stretch = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum m (u r' + x u'), u = phi eta
    flow = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum m (phi etadot) r', symmetric part
    turn = (0.0, 0.0, 0.0)  # and axial vector
    momentum = (0.0, 0.0, 0.0)  # sum m phi etadot
    for n in range(nm):
        eta, etad = w.mode[k, n].eta, w.mode[k, n].etad
        P, axial = symmetric(p, n, nm), vector(p, AXIAL * nm + n, nm)  # sum m phi_n r'
        swirl = vector(p, NUMBERS * nm + n, nm)  # axial vector of sum m phi_n (phi etadot)'
        translation = vec3(c.mode[k, n].mfr, 3)
        store3(w.mode[k, n].pfr, 0, axial)
        store3(w.mode[k, n].pfr, 3, translation)
        w.mode[k, n].zf = sym_dot(spin, P) + 2.0 * dot(omega, swirl)
        stretch = sym_axpy(eta, sym_add(P, symmetric(at_rest, n, nm)), stretch)
        flow = sym_axpy(etad, P, flow)
        turn = axpy(etad, axial, turn)
        s = axpy(eta, translation, s)
        momentum = axpy(etad, translation, momentum)
    j = stretched(sym6(body, 4), stretch)
    store_inertia(w.body[k].inertia, 0, rigid_inertia(body[0], s, j))
    torque = add(cross(omega, sym_times(j, omega)), scale(2.0, coriolis(omega, flow, turn)))
    store3(w.body[k].force, 0, torque)
    store3(w.body[k].force, 3, cross(omega, add(cross(omega, s), scale(2.0, momentum))))


@helper
def centrifugal(omega):
    """W with w' P w - w'w tr P = W . P for symmetric P."""
    x, y, z = omega
    return -(y * y + z * z), -(x * x + z * z), -(x * x + y * y), 2.0 * x * y, 2.0 * x * z, 2.0 * y * z


@helper
def stretched(j, P):
    """Inertia J with sum m r r' changed by the symmetric P."""
    xx, yy, zz, xy, xz, yz = P
    return sym_add(j, (yy + zz, xx + zz, xx + yy, -xy, -xz, -yz))


@helper
def coriolis(omega, flow, turn):
    """tr(P) w - P w of P = sum m v r' with symmetric part `flow` and axial vector `turn`."""
    moved = add(sym_times(flow, omega), scale(0.5, cross(turn, omega)))
    return sub(scale(flow[0] + flow[1] + flow[2], omega), moved)


def tables(model: FlexibleModel, wheels: int) -> InertiaTables:
    """The polynomial part; every point whose inertia turns is summed."""
    return polynomial(modal_integrals(model), model)


def polynomial(i: ModalIntegrals, model: FlexibleModel) -> InertiaTables:
    """The same of known integrals."""
    mode, pair = empty_tables(model)
    pair["mff"], mode["mfr"] = i.M_ff, np.hstack([i.C0.T, i.s1.T])
    rigid = np.array([i.mass, *i.s0, *six(i.J0)])
    return InertiaTables(rigid, mode, pair, i.turning, blocks_of_cross_products(i.J1, i.J2))


LEVEL = FidelityLevel(
    name="full",
    inertia_and_bias=inertia_and_bias,
    without_masses=coupling_and_bias,
    tables=tables,
    cost=1.4,
)
