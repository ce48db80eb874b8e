"""Level full: exact kinematics of the linear modal field; the kinetic energy is the sum over inertia points.

Point r = x + phi eta, point rotation exp(skew(psi eta)). The kinetic energy of masses at the points themselves is a
polynomial in eta, with the integrals P0_n = sum m phi_n x' and P1_ni = sum m phi_n phi_i' as coefficients: an
evaluation needs no sum over these points. Points with turning inertia, or with a mass centre off the point, are summed.
"""

import numpy as np

from flexmb.jit.kernel import helper, kernel
from flexmb.jit.strips import ROW, put, put_across, strip, width
from flexmb.levels.affine_integrals import axial_vector, columns_of, sum_integrals, symmetric_part, table_of_products
from flexmb.levels.level import FidelityLevel, InertiaTables, six
from flexmb.levels.masses import modal_masses
from flexmb.levels.summed_point import add_points
from flexmb.modal.flexible_model import FlexibleModel
from flexmb.modal.integrals import ModalIntegrals, modal_integrals
from flexmb.spatial.inertia import rigid_inertia, store_inertia
from flexmb.spatial.rows import strips3, total3, total_sym
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


@kernel
def inertia_and_bias(c, w, k):
    """Modal masses, then coupling and bias of the polynomial part, then the summed points."""
    modal_masses(c, w, k)
    coupling_and_bias(c, w, k)
    add_points(c, w, k)


@helper
def coupling_and_bias(c, w, k):
    """Coupling P_fr, rigid block and bias of the polynomial part.

    The bias consists of the integrals of r x a, a and phi_n . a with the point acceleration
    a = w x (w x r) + 2 w x (phi etadot).
    """
    nm, row = c.body[k].modes, c.body[k].product
    omega = vec3(w.body[k].velocity, 0)
    spin = centrifugal(omega)
    body = c.body[k].rigid
    moved = (0.0, 0.0, 0.0)  # sum m phi eta
    stretch = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum m (u r' + x u'), u = phi eta
    flow = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum m (phi etadot) r', symmetric part
    turn = (0.0, 0.0, 0.0)  # the same, axial vector
    momentum = (0.0, 0.0, 0.0)  # sum m phi etadot
    for n in range(0, nm, width(w)):
        eta, etad = strip(w, w.eta[k], n), strip(w, w.etad[k], n)
        now, rate = sum_integrals(w, k, c.product[row], c.moves[row], nm, n)
        P, axial = symmetric_part(now), axial_vector(now)  # of sum m phi_n r'
        swirl = axial_vector(rate)  # of sum m phi_n (phi etadot)'
        translation = strips3(w, c.mfr[k], 3, n)
        put_across(w, w.pfr[k], n, (axial, translation))
        put(w, w.zf[k], n, sym_dot(spin, P) + 2.0 * dot(omega, swirl))
        stretch = sym_axpy(eta, sym_add(P, _at_rest(w, c.product[row, n // ROW, 0], n % ROW)), stretch)
        flow = sym_axpy(etad, P, flow)
        turn = axpy(etad, axial, turn)
        moved = axpy(eta, translation, moved)
        momentum = axpy(etad, translation, momentum)
    s = add(vec3(body, 1), total3(w, moved))
    j = stretched(sym6(body, 4), total_sym(w, stretch))
    store_inertia(w.body[k].inertia, 0, rigid_inertia(body[0], s, j))
    swept = coriolis(omega, total_sym(w, flow), total3(w, turn))
    store3(w.body[k].force, 0, add(cross(omega, sym_times(j, omega)), scale(2.0, swept)))
    store3(w.body[k].force, 3, cross(omega, add(cross(omega, s), scale(2.0, total3(w, momentum)))))


@helper
def _at_rest(w, block, at):
    """Symmetric part of sum m phi_n x' at rest."""
    return symmetric_part(columns_of(w, block, at))


@helper
def centrifugal(omega):
    """Coefficients W with W . P = w' P w - w'w tr P for symmetric P, where . is the sum of six products."""
    x, y, z = omega
    return -(y * y + z * z), -(x * x + z * z), -(x * x + y * y), 2.0 * x * y, 2.0 * x * z, 2.0 * y * z


@helper
def stretched(j, P):
    """The inertia J after sum m r r' has increased by the symmetric P: J + tr(P) 1 - P."""
    xx, yy, zz, xy, xz, yz = P
    return sym_add(j, (yy + zz, xx + zz, xx + yy, -xy, -xz, -yz))


@helper
def coriolis(omega, flow, turn):
    """tr(P) w - P w for P = sum m v r' with symmetric part `flow` and axial vector `turn`."""
    moved = add(sym_times(flow, omega), scale(0.5, cross(turn, omega)))
    return sub(scale(flow[0] + flow[1] + flow[2], omega), moved)


def tables(model: FlexibleModel, wheels: int) -> InertiaTables:
    """Tables of the polynomial part; every point whose inertia turns is summed."""
    return polynomial(modal_integrals(model), model)


def polynomial(i: ModalIntegrals, model: FlexibleModel) -> InertiaTables:
    """`tables` from known integrals."""
    rigid, mfr = np.array([i.mass, *i.s0, *six(i.J0)]), np.vstack([i.C0, i.s1])
    product = table_of_products(i.J1, i.J2, len(model.mass))
    return InertiaTables(rigid, i.M_ff, mfr, np.zeros_like(mfr), i.turning, product)


LEVEL = FidelityLevel(
    name="full",
    inertia_and_bias=inertia_and_bias,
    without_masses=coupling_and_bias,
    tables=tables,
    cost=1.4,
)
