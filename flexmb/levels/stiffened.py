"""Level stiffened: level full with the second-order field u = phi eta + 1/2 eta' G eta, hence geometric stiffness.

The kinetic energy of the masses is cut off after the terms of G that are of second order in (eta, etadot): it stays one
function, and with r for places at rest and Z_ni = sum m G_ni

    first moment   s     = s0 + sum eta_n L0_n + 1/2 sum eta_n eta_i Z_ni
    coupling       L_n   = L0_n + sum eta_i Z_ni
                   C_n   = C0_n + sum eta_i sum m (phi_i x phi_n + r x G_ni)
    inertia        as that of full, with u r' + r u' of the whole displacement u
    M_ff           constant

Lagrange's equations of it differ from those of full by sum m G_ni r' beside P1_ni = sum m phi_n phi_i', except in the
Coriolis force on the modes, which has P1 alone, and by the force etadot' Z etadot with its torque sum m r x etadot' G
etadot. Spin stiffens through the inertia; gravity, the acceleration of the ground, through s and L. What is dropped is
of third order. Points that are summed move with the second-order field exactly.
"""

from flexmb.kernel import helper
from flexmb.levels.full import axial, mat_axpy
from flexmb.levels.summed_point import add_point
from flexmb.spatial.inertia import rigid_inertia, store_inertia
from flexmb.spatial.vector import add, axpy, cross, dot, mat3, scale, store3, sub, sym6, sym_add, sym_times, times, vec3


@helper
def inertia_and_bias(c, w, k):
    """Polynomial part, then the summed points."""
    _polynomial(c, w, k)
    for j in range(c.body[k].point_start, c.body[k].point_stop):
        add_point(c, w, k, j)


@helper
def _polynomial(c, w, k):
    """Rigid block and bias; `_mode` leaves the coupling and the force of every mode."""
    omega = vec3(w.body[k].velocity, 0)
    body = c.body[k].rigid
    s = vec3(body, 1)
    stretch = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # symmetric part: sum m (u r' + x u')
    flow = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum m rho_dot rho'
    momentum = (0.0, 0.0, 0.0)  # sum m rho_dot
    bend = (0.0, 0.0, 0.0)  # etadot' Z etadot
    swing = (0.0, 0.0, 0.0)  # sum m r x (etadot' G etadot)
    for n in range(c.body[k].modes):
        p0 = mat3(c.mode[k, n].moment, 0)
        p, translation, bend_n, swing_n = _mode(c, w, k, n, omega)
        eta = w.mode[k, n].eta
        etad = w.mode[k, n].etad
        transposed = (p0[0], p0[3], p0[6], p0[1], p0[4], p0[7], p0[2], p0[5], p0[8])
        stretch = mat_axpy(eta, transposed, mat_axpy(eta, p, stretch))
        flow = mat_axpy(etad, p, flow)
        s = axpy(0.5 * eta, add(vec3(c.mode[k, n].mfr, 3), translation), s)
        momentum = axpy(etad, translation, momentum)
        bend = axpy(etad, bend_n, bend)
        swing = axpy(etad, swing_n, swing)
    xx, yy, zz = stretch[0], stretch[4], stretch[8]
    xy, xz, yz = stretch[1] + stretch[3], stretch[2] + stretch[6], stretch[5] + stretch[7]
    j = sym_add(sym6(body, 4), (yy + zz, xx + zz, xx + yy, -0.5 * xy, -0.5 * xz, -0.5 * yz))
    store_inertia(w.body[k].inertia, 0, rigid_inertia(body[0], s, j))
    coriolis = sub(scale(flow[0] + flow[4] + flow[8], omega), times(flow, omega))
    torque = add(cross(omega, sym_times(j, omega)), scale(2.0, coriolis))
    store3(w.body[k].force, 0, add(torque, swing))
    store3(w.body[k].force, 3, add(cross(omega, add(cross(omega, s), scale(2.0, momentum))), bend))


@helper
def _mode(c, w, k, n, omega):
    """Coupling, modal masses and force of mode n.

    Returns sum m L_n rho' (9) to first order, L_n (3), and what the mode adds by its speed to `bend` and `swing`.
    """
    row = c.body[k].second
    p = mat3(c.mode[k, n].moment, 0)
    translation = vec3(c.mode[k, n].mfr, 3)
    bend = (0.0, 0.0, 0.0)
    swing = (0.0, 0.0, 0.0)  # sum_i etadot_i sum m (phi_i x phi_n + r x G_ni)
    against = (0.0, 0.0, 0.0)  # the same with n and i exchanged in each term
    for i in range(c.body[k].modes):
        eta = w.mode[k, i].eta
        etad = w.mode[k, i].etad
        product = mat3(c.pair[k, n, i].product, 0)
        z = vec3(c.second_moment[row, n, i], 0)
        p = mat_axpy(eta, product, p)
        translation = axpy(eta, z, translation)
        bend = axpy(etad, z, bend)
        swing = axpy(etad, axial(product), swing)
        against = axpy(etad, axial(mat3(c.pair[k, i, n].product, 0)), against)
        w.pff[k, n, i] = c.pair[k, n, i].mff
    store3(w.mode[k, n].pfr, 0, axial(p))
    store3(w.mode[k, n].pfr, 3, translation)
    centrifugal = dot(omega, times(p, omega)) - dot(omega, omega) * (p[0] + p[4] + p[8])
    # phi_i x phi_n is antisymmetric in the modes, r x G_ni symmetric
    w.mode[k, n].zf = centrifugal + dot(omega, sub(swing, against))
    return p, translation, bend, swing
