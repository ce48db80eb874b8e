"""Modes eliminated by an explicit Cholesky factor of D_f, (63), (64): for any body, at any level, with any hinge.

After the inward sweep the workspace holds L of D_f = L L' (w.pff), L^-1 P_fr (w.mode.pfr) and L^-1 z_f (w.mode.zf).
"""

from flexmb.jain.doubt import note_modes
from flexmb.jain.forces import add_port_force
from flexmb.jain.ports import mode_motion
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import kept, some
from flexmb.levels.body import RIGID
from flexmb.spatial.inertia import (
    add_inertia,
    add_rigid,
    inertia_times,
    load_inertia,
    outer_inertia,
    rotate_inertia,
    rotate_without,
    shift_inertia,
    store_inertia,
    sum_inertia,
)
from flexmb.spatial.pivots import SINGULAR
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.spatial_vector import (
    add6,
    axpy6,
    dot6,
    less6,
    plus6,
    scale6,
    shift_force,
    store6,
    times6,
    vec6,
)
from flexmb.spatial.vector import cross, mat3, scale, sub, sym6, vec3
from flexmb.tables.features import INBOARD_NODES, MODES, OUTBOARD_NODES


@helper
def eliminate_modes(c, w, k):
    """D_f = L L', P_R = P_rr - P_rf D_f^-1 P_fr and z_R likewise, about O; L^-1 P_fr and L^-1 z_f are kept."""
    nm = c.body[k].modes
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        refer_to_hinge(c, w, k)
    if nm > 0 and not cholesky(w.pff[k], nm):
        return False
    note_modes(c, w, k, w.pff[k])
    P, z_r = load_inertia(w.body[k].inertia, 0), vec6(w.body[k].force, 0)
    for n in range(nm):
        P_fr, z = vec6(w.mode[k, n].pfr, 0), w.mode[k, n].zf
        for i in range(n):
            s = -w.pff[k, n, i]
            z += s * w.mode[k, i].zf
            P_fr = axpy6(s, vec6(w.mode[k, i].pfr, 0), P_fr)
        s = 1.0 / w.pff[k, n, n]
        P_fr, z = scale6(s, P_fr), s * z
        store6(w.mode[k, n].pfr, 0, P_fr)
        w.mode[k, n].zf = z
        z_r = axpy6(-z, P_fr, z_r)
        P = sum_inertia(P, outer_inertia(P_fr[0], P_fr[1], -1.0))
    store6(w.body[k].hinge_force, 0, z_r)
    store_inertia(w.body[k].hinge_inertia, 0, P)
    return True


@helper
def about_hinge(c, w, k):
    """P_R (21,) and z_R (6,) of body k about O: where nothing has modes, its own about its origin."""
    if has(c, MODES):
        return w.body[k].hinge_inertia, w.body[k].hinge_force
    return w.body[k].inertia, w.body[k].force


@helper
def cholesky(a, n):
    """Lower Cholesky factor of a[:n,:n] in place; False where it is not positive definite to round-off (or NaN)."""
    for j in range(n):
        d = a[j, j]
        floor = SINGULAR * d
        for i in range(j):
            d -= a[j, i] * a[j, i]
        sound = d.real > floor.real
        if not some(sound):
            return False
        d = sqrt(kept(sound, d))
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
    P_rr = load_inertia(w.body[k].inertia, 0)
    for n in range(c.body[k].modes):
        _add_momentum(c, w, k, n, P_rr, -0.5)
    for n in range(c.body[k].modes):
        B, P_fr = from_hinge(c, w, k, n), vec6(w.mode[k, n].pfr, 0)
        for m in range(n + 1):
            s = less6(w.pff[k, n, m], P_fr, from_hinge(c, w, k, m))
            s -= dot6(B, vec6(w.mode[k, m].pfr, 0))
            w.pff[k, n, m] = s
            w.pff[k, m, n] = s
    refer_coupling(c, w, k, -0.5)
    refer_rigid(c, w, k)


@helper
def from_hinge(c, w, k, n):
    """Column n of B: velocity of the body origin against the rate of mode n, O at rest."""
    i = c.body[k].outboard_port
    angular, linear = mode_motion(w, i, n)
    return angular, sub(linear, cross(angular, vec3(w.port[i].r, 0)))


@helper
def _add_momentum(c, w, k, n, P_rr, s):
    """P_fr += s B'P_rr, row n."""
    add6(w.mode[k, n].pfr, 0, scale6(s, inertia_times(P_rr, from_hinge(c, w, k, n))))


@helper
def refer_coupling(c, w, k, s):
    """(P_fr + s B'P_rr) X: loads of unit modal rates about O."""
    back = scale(-1.0, vec3(w.port[c.body[k].outboard_port].r, 0))
    P_rr = load_inertia(w.body[k].inertia, 0)
    for n in range(c.body[k].modes):
        _add_momentum(c, w, k, n, P_rr, s)
        store6(w.mode[k, n].pfr, 0, shift_force(vec6(w.mode[k, n].pfr, 0), back))


@helper
def refer_rigid(c, w, k):
    """z_f - B'z_r, X'P_rr X and X'z_r."""
    z_r = vec6(w.body[k].force, 0)
    for n in range(c.body[k].modes):
        w.mode[k, n].zf -= dot6(from_hinge(c, w, k, n), z_r)
    back = scale(-1.0, vec3(w.port[c.body[k].outboard_port].r, 0))
    store_inertia(w.body[k].inertia, 0, shift_inertia(load_inertia(w.body[k].inertia, 0), back))
    store6(w.body[k].force, 0, shift_force(z_r, back))


@helper
def to_parent(c, w, k, P, F, row):
    """P_R^+ and F = z_R^+ handed to the parent: P += A Gamma A', z += A z_R^+.

    A hinge with a single axis leaves no inertia along it: `row` of P_R^+ is zero then, negative for all other hinges.
    """
    R, arm = mat3(w.body[k].rotation, 0), vec3(w.body[k].arm, 0)
    rotated = rotate_inertia(R, P) if row < 0 else rotate_without(R, P, row)
    gamma = shift_inertia(rotated, arm)
    F_parent = shift_force(times6(R, F), arm)
    if has(c, RIGID) and c.body[k].starts:
        _start_inertia(c, w, c.body[k].parent, gamma)
    else:
        _add_inertia(c, w, k, gamma)
    _add_force(c, w, w, k, F_parent)


@helper
def _start_inertia(c, w, k, gamma):
    """P = gamma and the body's own, which is constant: stored once, where it would be written, read and written."""
    own = c.body[k].rigid
    store_inertia(w.body[k].inertia, 0, add_rigid(gamma, own[0], vec3(own, 1), sym6(own, 4)))


@helper
def inertia_to_parent(c, w, k, P):
    """P += A Gamma A' of the parent, Gamma = P_R^+ in its axes at its reference."""
    _add_inertia(c, w, k, shift_inertia(rotate_inertia(mat3(w.body[k].rotation, 0), P), vec3(w.body[k].arm, 0)))


@helper
def force_to_parent(c, w, z, k, F):
    """A F added to the parent's force; z holds forces: the workspace w, or a response to w's factors."""
    _add_force(c, w, z, k, shift_force(times6(mat3(w.body[k].rotation, 0), F), vec3(w.body[k].arm, 0)))


@helper
def _add_inertia(c, w, k, gamma):
    """P += A Gamma A' with A = [Pi'; phi] of body k's inboard port on the parent."""
    parent = c.body[k].parent
    if has(c, INBOARD_NODES):
        i = c.body[k].inboard_port
        if i >= 0:
            r = vec3(w.port[i].r, 0)
            for n in range(c.body[parent].modes):
                momentum = inertia_times(gamma, mode_motion(w, i, n))
                for m in range(n + 1):
                    s = dot6(momentum, mode_motion(w, i, m)) + w.pff[parent, n, m]
                    w.pff[parent, n, m] = s
                    w.pff[parent, m, n] = s
                add6(w.mode[parent, n].pfr, 0, shift_force(momentum, r))
            gamma = shift_inertia(gamma, r)
    add_inertia(w.body[parent].inertia, 0, gamma)


@helper
def _add_force(c, w, z, k, F_parent):
    """z += A F with A = [Pi'; phi] of body k's inboard port on the parent, F about it in the parent's axes."""
    parent, i = c.body[k].parent, c.body[k].inboard_port
    if has(c, INBOARD_NODES) and i >= 0:
        add_port_force(c, w, z, parent, i, F_parent)
    else:
        add6(z.body[parent].force, 0, F_parent)


@helper
def modal_accelerations(c, w, k, A):
    """Back substitution L' etadd = -(L^-1 z_f + L^-1 P_fr alpha) from the acceleration of O: outward half of (64)."""
    for n in range(c.body[k].modes - 1, -1, -1):
        P_fr = vec6(w.mode[k, n].pfr, 0)
        s = plus6(w.mode[k, n].zf, P_fr, A)
        for i in range(n + 1, c.body[k].modes):
            s += w.pff[k, i, n] * w.mode[k, i].etadd
        w.mode[k, n].etadd = -s / w.pff[k, n, n]
        w.speed[c.body[k].etad_index + n].acceleration = w.mode[k, n].etadd
