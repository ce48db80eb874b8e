"""Modes eliminated by an explicit Cholesky factor of D_f, (63), (64): for any body, at any level, with any hinge.

After the inward sweep the workspace holds L of D_f = L L' (w.pff), L^-1 P_fr (w.mode.pfr) and L^-1 z_f (w.mode.zf).
"""

from flexmb.jain.doubt import note_modes
from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import (
    add_inertia,
    inertia_times,
    load_inertia,
    outer_inertia,
    rotate_inertia,
    shift_inertia,
    store_inertia,
    sum_inertia,
)
from flexmb.spatial.pivots import SINGULAR
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.spatial_vector import shift_force
from flexmb.spatial.vector import add3, axpy, cross, dot, mat3, scale, store3, sub, times, vec3


@helper
def eliminate_modes(c, w, k):
    """D_f = L L', P_R = P_rr - P_rf D_f^-1 P_fr and z_R likewise, about O; L^-1 P_fr and L^-1 z_f are kept."""
    nm = c.body[k].modes
    if c.body[k].outboard_port >= 0:
        refer_to_hinge(c, w, k)
    if nm > 0 and not cholesky(w.pff[k], nm):
        return False
    note_modes(c, w, k, w.pff[k])
    p = load_inertia(w.body[k].inertia, 0)
    tau, f = vec3(w.body[k].force, 0), vec3(w.body[k].force, 3)
    for n in range(nm):
        angular, linear, z = vec3(w.mode[k, n].pfr, 0), vec3(w.mode[k, n].pfr, 3), w.mode[k, n].zf
        for i in range(n):
            s = -w.pff[k, n, i]
            z += s * w.mode[k, i].zf
            angular = axpy(s, vec3(w.mode[k, i].pfr, 0), angular)
            linear = axpy(s, vec3(w.mode[k, i].pfr, 3), linear)
        s = 1.0 / w.pff[k, n, n]
        angular, linear, z = scale(s, angular), scale(s, linear), s * z
        store3(w.mode[k, n].pfr, 0, angular)
        store3(w.mode[k, n].pfr, 3, linear)
        w.mode[k, n].zf = z
        tau, f = axpy(-z, angular, tau), axpy(-z, linear, f)
        p = sum_inertia(p, outer_inertia(angular, linear, -1.0))
    store3(w.body[k].hinge_force, 0, tau)
    store3(w.body[k].hinge_force, 3, f)
    store_inertia(w.body[k].hinge_inertia, 0, p)
    return True


@helper
def cholesky(a, n):
    """Lower Cholesky factor of a[:n,:n] in place; False where it is not positive definite to round-off (or NaN)."""
    for j in range(n):
        d = a[j, j]
        floor = SINGULAR * d
        for i in range(j):
            d -= a[j, i] * a[j, i]
        if not d.real > floor.real:
            return False
        d = sqrt(d)
        a[j, j] = d
        d = 1.0 / d
        for m in range(j + 1, n):
            s = a[m, j]
            for i in range(j):
                s -= a[m, i] * a[j, i]
            a[m, j] = d * s
    return True


@helper
def refer_to_hinge(c, w, k):
    """Refer P and z from the body origin to O on the deforming node d: the congruence with H_f of (13), (17).

    With V_body = X V_O - B etadot, B = X [W; L], X the shift from O to the origin: P_ff - B'P_rf - P_fr B + B'P_rr B,
    (P_fr - B'P_rr) X, X'P_rr X; z_f - B'z_r, X'z_r.
    """
    p = load_inertia(w.body[k].inertia, 0)
    for n in range(c.body[k].modes):
        _add_momentum(c, w, k, n, p, -0.5)
    for n in range(c.body[k].modes):
        angular, linear = from_hinge(c, w, k, n)
        torque, force = vec3(w.mode[k, n].pfr, 0), vec3(w.mode[k, n].pfr, 3)
        for m in range(n + 1):
            angular_m, linear_m = from_hinge(c, w, k, m)
            s = w.pff[k, n, m] - dot(torque, angular_m) - dot(force, linear_m)
            s -= dot(angular, vec3(w.mode[k, m].pfr, 0)) + dot(linear, vec3(w.mode[k, m].pfr, 3))
            w.pff[k, n, m] = s
            w.pff[k, m, n] = s
    refer_coupling(c, w, k, -0.5)
    refer_rigid(c, w, k)


@helper
def from_hinge(c, w, k, n):
    """Column n of B: velocity of the body origin against the rate of mode n, O at rest."""
    i = c.body[k].outboard_port
    angular = vec3(w.port_mode[i, n].W, 0)
    return angular, sub(vec3(w.port_mode[i, n].L, 0), cross(angular, vec3(w.port[i].r, 0)))


@helper
def _add_momentum(c, w, k, n, p, s):
    """P_fr += s B'P_rr, row n."""
    angular, linear = from_hinge(c, w, k, n)
    tau, f = inertia_times(p, (angular, linear))
    add3(w.mode[k, n].pfr, 0, scale(s, tau))
    add3(w.mode[k, n].pfr, 3, scale(s, f))


@helper
def refer_coupling(c, w, k, s):
    """(P_fr + s B'P_rr) X: loads of unit modal rates about O."""
    back = scale(-1.0, vec3(w.port[c.body[k].outboard_port].r, 0))
    p = load_inertia(w.body[k].inertia, 0)
    for n in range(c.body[k].modes):
        _add_momentum(c, w, k, n, p, s)
        tau, f = shift_force((vec3(w.mode[k, n].pfr, 0), vec3(w.mode[k, n].pfr, 3)), back)
        store3(w.mode[k, n].pfr, 0, tau)


@helper
def refer_rigid(c, w, k):
    """z_f - B'z_r, X'P_rr X and X'z_r."""
    tau, f = vec3(w.body[k].force, 0), vec3(w.body[k].force, 3)
    for n in range(c.body[k].modes):
        angular, linear = from_hinge(c, w, k, n)
        w.mode[k, n].zf -= dot(angular, tau) + dot(linear, f)
    back = scale(-1.0, vec3(w.port[c.body[k].outboard_port].r, 0))
    store_inertia(w.body[k].inertia, 0, shift_inertia(load_inertia(w.body[k].inertia, 0), back))
    tau, f = shift_force((tau, f), back)
    store3(w.body[k].force, 0, tau)


@helper
def to_parent(c, w, k, p, F):
    """P_R^+ and z_R^+ handed to the parent: P += A Gamma A', z += A z_R^+."""
    tau, f = F
    R, arm = mat3(w.body[k].rotation, 0), vec3(w.body[k].arm, 0)
    gamma = shift_inertia(rotate_inertia(R, p), arm)
    tau, f = shift_force((times(R, tau), times(R, f)), arm)
    _add_inertia(c, w, k, gamma)
    _add_force(c, w, w, k, tau, f)


@helper
def inertia_to_parent(c, w, k, p):
    """P += A Gamma A' of the parent, Gamma = P_R^+ in its axes at its reference."""
    _add_inertia(c, w, k, shift_inertia(rotate_inertia(mat3(w.body[k].rotation, 0), p), vec3(w.body[k].arm, 0)))


@helper
def force_to_parent(c, w, z, k, F):
    """A [tau; f] added to the parent's force; z holds forces: the workspace w, or a response to w's factors."""
    tau, f = F
    R = mat3(w.body[k].rotation, 0)
    tau, f = shift_force((times(R, tau), times(R, f)), vec3(w.body[k].arm, 0))
    _add_force(c, w, z, k, tau, f)


@helper
def _add_inertia(c, w, k, gamma):
    """P += A Gamma A' with A = [Pi'; phi] of body k's inboard port on the parent."""
    parent = c.body[k].parent
    i = c.body[k].inboard_port
    if i >= 0:
        r = vec3(w.port[i].r, 0)
        for n in range(c.body[parent].modes):
            angular, linear = vec3(w.port_mode[i, n].W, 0), vec3(w.port_mode[i, n].L, 0)
            tau_n, f_n = inertia_times(gamma, (angular, linear))
            for m in range(n + 1):
                s = dot(tau_n, vec3(w.port_mode[i, m].W, 0)) + dot(f_n, vec3(w.port_mode[i, m].L, 0))
                s += w.pff[parent, n, m]
                w.pff[parent, n, m] = s
                w.pff[parent, m, n] = s
            tau_n, f_n = shift_force((tau_n, f_n), r)
            add3(w.mode[parent, n].pfr, 0, tau_n)
            add3(w.mode[parent, n].pfr, 3, f_n)
        gamma = shift_inertia(gamma, r)
    add_inertia(w.body[parent].inertia, 0, gamma)


@helper
def _add_force(c, w, z, k, tau, f):
    """z += A [tau; f] with A = [Pi'; phi] of body k's inboard port on the parent."""
    parent = c.body[k].parent
    i = c.body[k].inboard_port
    if i >= 0:
        for n in range(c.body[parent].modes):
            z.mode[parent, n].zf += dot(vec3(w.port_mode[i, n].W, 0), tau) + dot(vec3(w.port_mode[i, n].L, 0), f)
        tau, f = shift_force((tau, f), vec3(w.port[i].r, 0))
    add3(z.body[parent].force, 0, tau)
    add3(z.body[parent].force, 3, f)


@helper
def modal_accelerations(c, w, k, A):
    """Back substitution L' etadd = -(L^-1 z_f + L^-1 P_fr alpha) from the acceleration of O: outward half of (64)."""
    alpha, a = A
    for n in range(c.body[k].modes - 1, -1, -1):
        s = w.mode[k, n].zf + dot(vec3(w.mode[k, n].pfr, 0), alpha) + dot(vec3(w.mode[k, n].pfr, 3), a)
        for i in range(n + 1, c.body[k].modes):
            s += w.pff[k, i, n] * w.mode[k, i].etadd
        w.mode[k, n].etadd = -s / w.pff[k, n, n]
        w.speed[c.body[k].etad_index + n].acceleration = w.mode[k, n].etadd
