"""Modes eliminated by the factors D_f = L D L', (63), (64): for any body, at any level, with any hinge.

L has a unit diagonal, D is that of the pivots: no square root is taken. After the inward sweep the workspace holds D L'
(w.pff, upper triangle; what is below means nothing), D^-1 (w.inverse_pivot), L^-1 P_fr (w.pfr) and L^-1 z_f (w.zf).
"""

from flexmb.jain.doubt import note_mode
from flexmb.jain.forces import add_port_force
from flexmb.jain.ports import mode_motion
from flexmb.jit.features import has
from flexmb.jit.kernel import by_width, helper
from flexmb.jit.lanes import kept, some
from flexmb.jit.strips import after, put, start, strip, width
from flexmb.spatial.inertia import (
    add_inertia,
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
from flexmb.spatial.rows import add_column6, column6, put6, store_column6, strips6, total6, total_inertia
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.spatial_vector import (
    ZERO6,
    add6,
    axpy6,
    dot6,
    less6,
    plus6,
    scale6,
    shift_force,
    store6,
    sum6,
    times6,
    vec6,
)
from flexmb.spatial.vector import cross, mat3, scale, sub, vec3
from flexmb.tables.features import INBOARD_NODES, MODES, OUTBOARD_NODES


@helper
def eliminate_modes(c, w, k):
    """D_f = L D L', P_R = P_rr - P_rf D_f^-1 P_fr and z_R likewise, about O; L^-1 P_fr and L^-1 z_f are kept."""
    nm = c.body[k].modes
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        refer_to_hinge(c, w, k)
    for n in range(nm):
        floor = SINGULAR * w.pff[k, n, n]
        _next_row(c, w, k, n)
        pivot = w.pff[k, n, n]
        sound = pivot.real > floor.real
        if not some(sound):
            return False
        pivot = kept(sound, pivot)
        note_mode(c, w, k, n, pivot)
        w.inverse_pivot[k, n] = 1.0 / pivot
        _next_loads(c, w, k, n)
    six, nine = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    P, z_r = (six, nine, six), ZERO6
    for n in range(0, nm, width(w)):
        P_fr, z_f, weight = strips6(w, w.pfr[k], n), strip(w, w.zf[k], n), -strip(w, w.inverse_pivot[k], n)
        P = sum_inertia(P, outer_inertia(P_fr[0], P_fr[1], weight))
        z_r = axpy6(weight * z_f, P_fr, z_r)
    store6(w.body[k].hinge_force, 0, sum6(vec6(w.body[k].force, 0), total6(w, z_r)))
    store_inertia(w.body[k].hinge_inertia, 0, sum_inertia(load_inertia(w.body[k].inertia, 0), total_inertia(w, P)))
    return True


@helper
def _next_row(c, w, k, n):
    """Row n of D L' from that of D_f and the rows before: its diagonal element is the pivot."""
    D, factor = w.pff[k], w.point_mode[0]
    for i in range(n):
        factor[i] = w.inverse_pivot[k, i] * D[i, n]
    for m in range(start(w, n), c.body[k].modes, width(w)):
        row = strip(w, D[n], m)
        for i in range(n):
            row -= factor[i] * strip(w, D[i], m)
        put(w, D[n], m, row)


@helper
def _one_by_one(c, w, k, n):
    """Loads of mode n, from which those of the modes before are taken: for vectors, which are stored but once."""
    P_fr, z = column6(w.pfr[k], n), w.zf[k, n]
    for i in range(n):
        s = -w.point_mode[0, i]
        z += s * w.zf[k, i]
        P_fr = axpy6(s, column6(w.pfr[k], i), P_fr)
    store_column6(w.pfr[k], n, P_fr)
    w.zf[k, n] = z


@helper
def _from_all_after(c, w, k, n):
    """Loads of mode n taken from those of all modes after it, in strips."""
    s = -w.inverse_pivot[k, n]
    P_fr, z = scale6(s, column6(w.pfr[k], n)), s * w.zf[k, n]
    for m in range(start(w, n + 1), c.body[k].modes, width(w)):
        row = after(w, strip(w, w.pff[k, n], m), m, n)
        put6(w, w.pfr[k], m, axpy6(row, P_fr, strips6(w, w.pfr[k], m)))
        put(w, w.zf[k], m, strip(w, w.zf[k], m) + z * row)


_next_loads = by_width(_from_all_after, _one_by_one)  # rows of L^-1 P_fr and L^-1 z_f


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
        B, P_fr = from_hinge(c, w, k, n), column6(w.pfr[k], n)
        for m in range(n + 1):
            s = less6(w.pff[k, m, n], P_fr, from_hinge(c, w, k, m))
            w.pff[k, m, n] = s - dot6(B, column6(w.pfr[k], m))
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
    add_column6(w.pfr[k], n, scale6(s, inertia_times(P_rr, from_hinge(c, w, k, n))))


@helper
def refer_coupling(c, w, k, s):
    """(P_fr + s B'P_rr) X: loads of unit modal rates about O."""
    back = scale(-1.0, vec3(w.port[c.body[k].outboard_port].r, 0))
    P_rr = load_inertia(w.body[k].inertia, 0)
    for n in range(c.body[k].modes):
        _add_momentum(c, w, k, n, P_rr, s)
        store_column6(w.pfr[k], n, shift_force(column6(w.pfr[k], n), back))


@helper
def refer_rigid(c, w, k):
    """z_f - B'z_r, X'P_rr X and X'z_r."""
    z_r = vec6(w.body[k].force, 0)
    for n in range(c.body[k].modes):
        w.zf[k, n] -= dot6(from_hinge(c, w, k, n), z_r)
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
    _add_inertia(c, w, k, gamma)
    _add_force(c, w, w, k, F_parent)


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
            _add_to_modes(c, w, parent, i, gamma, r)
            gamma = shift_inertia(gamma, r)
    add_inertia(w.body[parent].inertia, 0, gamma)


@helper
def _add_to_modes(c, w, k, i, gamma, r):
    """Pi' Gamma Pi added to P_ff, upper triangle, and phi Gamma Pi to P_fr, of port i of body k, at r."""
    nm, modes, momenta = c.body[k].modes, w.port_mode[i], w.point_mode
    for n in range(0, nm, width(w)):
        momentum = inertia_times(gamma, strips6(w, modes, n))
        put6(w, momenta, n, momentum)
        put6(w, w.pfr[k], n, sum6(strips6(w, w.pfr[k], n), shift_force(momentum, r)))
        for m in range(n, min(n + width(w), nm)):
            for j in range(n, nm, width(w)):
                row = plus6(strip(w, w.pff[k, m], j), column6(momenta, m), strips6(w, modes, j))
                put(w, w.pff[k, m], j, row)


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
    """Back substitution L' etadd = -D^-1 (L^-1 z_f + L^-1 P_fr alpha) from the acceleration of O: outward half of (64)."""
    nm = c.body[k].modes
    for n in range(0, nm, width(w)):
        put(w, w.etadd[k], n, plus6(strip(w, w.zf[k], n), strips6(w, w.pfr[k], n), A))
    for n in range(nm - 1, -1, -1):
        s = w.etadd[k, n]
        for i in range(n + 1, nm):
            s += w.pff[k, n, i] * w.etadd[k, i]
        w.etadd[k, n] = -w.inverse_pivot[k, n] * s
        w.speed[c.body[k].etad_index + n].acceleration = w.etadd[k, n]
