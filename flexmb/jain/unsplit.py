"""Articulated-body forward dynamics by (51), (58): the modes and the hinge of a body are eliminated together.

D = script-H P script-H' of order n_m + n_r is factorised as a whole, D = L L'. The split algorithm (63), (64) of
`flexmb.jain.sweeps` is checked against this one.
"""

from flexmb.jain.accelerations import inboard_acceleration, store_body_acceleration
from flexmb.jain.doubt import note_hinge, note_mode
from flexmb.jain.explicit import about_hinge, cholesky, refer_to_hinge, to_parent
from flexmb.jain.hinge_solve import find_free, impose
from flexmb.jain.kinematics import motion_column
from flexmb.jain.sweeps import bodies
from flexmb.jain.wheels import wheel_acceleration
from flexmb.jit.bundle import bundle
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.inertia import add_inertia, inertia_times, load_inertia, outer_inertia, store_inertia
from flexmb.spatial.spatial_vector import add6, axpy6, dot6, less6, plus6, store6, sub6, sum6, vec6
from flexmb.tables.arrays import NO_AXIS
from flexmb.tables.features import ARMATURES
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK
from flexmb.typing import Real


@bundle
class Joint:
    """Modes and free hinge speeds of each body, in this order, as one joint."""

    D: Real  # (N,m+6,m+6), then its Cholesky factor L
    gain: Real  # (N,m+6,6) rigid columns of script-H P, then L^-1 of them: the rigid part of G L, transposed
    residual: Real  # (N,m+6) epsilon, then L^-1 of it, then the speeds' rates


@helper
def forward_dynamics(c, w, x):
    """Accelerations to w.speed.acceleration; returns a status code.

    P^+ and z^+ are stored in the places of P_R and z_R. Loads across hinges are f = P^+ alpha^+ + z^+. At the end z^+
    is replaced by f - P^+ alpha, so that `flexmb.jain.loads`, which evaluates P_R alpha + z_R, gives f.
    """
    status = bodies(c, w)
    if status != OK:
        return status
    w.doubt[0] = 0
    for k in range(c.body.shape[0] - 1, -1, -1):
        if not _eliminate(c, w, x, k):
            w.fault[0] = k
            return NOT_POSITIVE_DEFINITE
    for k in range(c.body.shape[0]):
        _accelerate(c, w, x, k)
    return OK


@helper
def _eliminate(c, w, x, k):
    """D, G, P^+ = (1 - G script-H) P and z^+ = z + P a + G epsilon of (51), (58) about O; adds them to the parent."""
    nm = c.body[k].modes
    if c.body[k].outboard_port >= 0:
        refer_to_hinge(c, w, k)
    impose(c, w, k)
    P, a = load_inertia(w.body[k].inertia, 0), vec6(w.body[k].bias, 0)
    z = sum6(vec6(w.body[k].force, 0), inertia_times(P, a))
    D, gain, residual = x.D[k], x.gain[k], x.residual[k]
    _mode_rows(c, w, x, k, a)
    rows = nm + find_free(c, w, k)
    for n in range(nm, rows):
        j = w.hinge[k].free_speed[n - nm]
        H = motion_column(c, w, k, j)
        F = inertia_times(P, H)
        store6(gain[n], 0, F)
        residual[n] = less6(w.speed[c.body[k].u_index + j].applied, H, z)
        for i in range(nm):
            D[n, i] = dot6(vec6(gain[i], 0), H)
        for i in range(nm, n + 1):
            D[n, i] = dot6(F, motion_column(c, w, k, w.hinge[k].free_speed[i - nm]))
        if has(c, ARMATURES):
            D[n, n] += c.speed[c.body[k].u_index + j].armature
    if not cholesky(D, rows):
        return False
    for n in range(nm):
        note_mode(c, w, k, n, D[n, n] * D[n, n])
    note_hinge(c, w, k, D, nm)
    P_plus, z_plus = about_hinge(c, w, k)
    store_inertia(P_plus, 0, P)
    for n in range(rows):
        for i in range(n):
            residual[n] -= D[n, i] * residual[i]
            for b in range(6):
                gain[n, b] -= D[n, i] * gain[i, b]
        s = 1.0 / D[n, n]
        residual[n] *= s
        for b in range(6):
            gain[n, b] *= s
        G = vec6(gain[n], 0)
        add_inertia(P_plus, 0, outer_inertia(G[0], G[1], -1.0))
        z = axpy6(residual[n], G, z)
    store6(z_plus, 0, z)
    if c.body[k].parent >= 0:
        to_parent(c, w, k, load_inertia(P_plus, 0), z, NO_AXIS)
    return True


@helper
def _mode_rows(c, w, x, k, a):
    """Rows of the modes in D = script-H P script-H', script-H P and epsilon = T - script-H (z + P a)."""
    D, gain, residual = x.D[k], x.gain[k], x.residual[k]
    for n in range(c.body[k].modes):
        P_fr = vec6(w.pfr[k, n], 0)
        store6(gain[n], 0, P_fr)
        residual[n] = -plus6(w.zf[k, n], P_fr, a)
        for i in range(n + 1):
            D[n, i] = w.pff[k, i, n]


@helper
def _accelerate(c, w, x, k):
    """chi_dot = nu - G' alpha^+ and alpha = alpha^+ + script-H' chi_dot + a: the outward half of (58)."""
    nm = c.body[k].modes
    rows = nm + w.body[k].free_count
    D, gain, rates = x.D[k], x.gain[k], x.residual[k]
    A_plus = inboard_acceleration(c, w, k)
    for n in range(rows - 1, -1, -1):
        s = less6(rates[n], vec6(gain[n], 0), A_plus)
        for i in range(n + 1, rows):
            s -= D[i, n] * rates[i]
        rates[n] = s / D[n, n]
    for n in range(nm):
        w.etadd[k, n] = rates[n]
        w.speed[c.body[k].etad_index + n].acceleration = rates[n]
    A = sum6(A_plus, vec6(w.body[k].bias, 0))
    for n in range(nm, rows):
        j = w.hinge[k].free_speed[n - nm]
        w.speed[c.body[k].u_index + j].acceleration = rates[n]
        A = axpy6(rates[n], motion_column(c, w, k, j), A)
    store_body_acceleration(c, w, k, A)
    P_plus, z_plus = about_hinge(c, w, k)
    add6(z_plus, 0, inertia_times(load_inertia(P_plus, 0), sub6(A_plus, A)))
    for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
        wheel_acceleration(c, w, k, i)
