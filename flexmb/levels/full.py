"""Level full: exact kinematics of the linear modal field; the kinetic energy is the sum over inertia points.

Point r = x + phi eta, point rotation exp(skew(psi eta)). Mass at the points themselves gives a kinetic energy that is
polynomial in eta: it is carried by the integrals P0_n = sum m phi_n x' and P1_nm = sum m phi_n phi_m', no sum over
points is left. Points with rotating inertia, or with a mass centre off the point, are summed.
"""

from flexmb.kernel import helper
from flexmb.levels.summed_point import add_point
from flexmb.spatial.inertia import rigid_inertia, store_inertia
from flexmb.spatial.vector import (
    add,
    axpy,
    cross,
    dot,
    mat3,
    scale,
    store3,
    sub,
    sym6,
    sym_add,
    sym_times,
    times,
    vec3,
)


@helper
def _axial(m):
    """sum m_j b_j x a_j of a matrix sum m_j a_j b_j'."""
    return m[7] - m[5], m[2] - m[6], m[3] - m[1]


@helper
def _mat_axpy(s, a, b):
    """s A + B for 9-tuples."""
    return (
        s * a[0] + b[0],
        s * a[1] + b[1],
        s * a[2] + b[2],
        s * a[3] + b[3],
        s * a[4] + b[4],
        s * a[5] + b[5],
        s * a[6] + b[6],
        s * a[7] + b[7],
        s * a[8] + b[8],
    )


@helper
def inertia_and_bias(c, w, k):
    """Polynomial part, then the summed points."""
    _polynomial(c, w, k)
    for j in range(c.body[k].point_start, c.body[k].point_stop):
        add_point(c, w, k, j)


@helper
def _polynomial(c, w, k):
    """Integrals of r x (.) and phi_n . (.) of the point acceleration w x (w x r) + 2 w x (phi etadot)."""
    nm = c.body[k].modes
    omega = vec3(w.body[k].velocity, 0)
    w2 = dot(omega, omega)
    body = c.body[k].rigid
    s = vec3(body, 1)
    stretch = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum m (u r' + x u'), u = phi eta
    flow = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum m (phi etadot) r'
    momentum = (0.0, 0.0, 0.0)  # sum m phi etadot
    for n in range(nm):
        p0 = mat3(c.mode[k, n].moment, 0)
        p = p0  # P_n = sum m phi_n r'
        swirl = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)  # sum m phi_n (phi etadot)'
        for i in range(nm):
            p1 = mat3(c.pair[k, n, i].product, 0)
            p = _mat_axpy(w.mode[k, i].eta, p1, p)
            swirl = _mat_axpy(w.mode[k, i].etad, p1, swirl)
            w.pff[k, n, i] = c.pair[k, n, i].mff
        translation = vec3(c.mode[k, n].mfr, 3)
        store3(w.mode[k, n].pfr, 0, _axial(p))
        store3(w.mode[k, n].pfr, 3, translation)
        centrifugal = dot(omega, times(p, omega)) - w2 * (p[0] + p[4] + p[8])
        w.mode[k, n].zf = centrifugal + 2.0 * dot(omega, _axial(swirl))
        eta = w.mode[k, n].eta
        etad = w.mode[k, n].etad
        transposed = (p0[0], p0[3], p0[6], p0[1], p0[4], p0[7], p0[2], p0[5], p0[8])
        stretch = _mat_axpy(eta, transposed, _mat_axpy(eta, p, stretch))
        flow = _mat_axpy(etad, p, flow)
        s = axpy(eta, translation, s)
        momentum = axpy(etad, translation, momentum)
    xx, yy, zz = stretch[0], stretch[4], stretch[8]
    j = sym_add(sym6(body, 4), (yy + zz, xx + zz, xx + yy, -stretch[1], -stretch[2], -stretch[5]))
    store_inertia(w.body[k].inertia, 0, rigid_inertia(body[0], s, j))
    coriolis = sub(scale(flow[0] + flow[4] + flow[8], omega), times(flow, omega))
    store3(w.body[k].force, 0, add(cross(omega, sym_times(j, omega)), scale(2.0, coriolis)))
    store3(w.body[k].force, 3, cross(omega, add(cross(omega, s), scale(2.0, momentum))))
