"""Elimination of the modes by the factors D_f = L D L', (63), (64): for any body, at any level, with any hinge.

L has a unit diagonal and D holds the pivots; no square root is needed, on which the next pivot would wait. After the
inward sweep the workspace holds D L' (w.pff, upper triangle; the rest is undefined), D^-1 (w.inverse_pivot) and the
rows of L^-1 [P_fr z_f] (w.pfr).
"""

from flexmb.jain.doubt import note_mode
from flexmb.jain.forces import add_port_force
from flexmb.jain.ports import mode_motion
from flexmb.jit.features import has
from flexmb.jit.kernel import by_width, helper
from flexmb.jit.lanes import kept, some
from flexmb.jit.strips import add_across, put, start, strip, width, with_seventh
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
from flexmb.spatial.rows import axpy3, column6, column_inertia, put6, strips6
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
from flexmb.spatial.vector import cross, mat3, scale, sub, sym6, vec3
from flexmb.tables.features import INBOARD_NODES, MODES, OUTBOARD_NODES

LOAD = 6  # column of L^-1 z_f in w.pfr, behind the six of L^-1 P_fr


@helper
def eliminate_modes(c, w, k):
    """D_f = L D L', P_R = P_rr - P_rf D_f^-1 P_fr and z_R = z_r - P_rf D_f^-1 z_f about O; stores L^-1 [P_fr z_f].

    Returns False if a pivot is not above rounding.
    """
    if has(c, OUTBOARD_NODES) and c.body[k].outboard_port >= 0:
        refer_to_hinge(c, w, k)
    return _eliminate(c, w, k)


@helper
def _one_by_one(c, w, k):
    """Left-looking elimination of [D_f P_fr z_f]: each row is reduced by all rows before it, then stored once.

    For lanes and duals, whose numbers are vectors: here stores and loads cost more than the order of the sums.
    """
    D, factor = w.pff[k], w.point_mode[0]
    P, z_r = load_inertia(w.body[k].inertia, 0), vec6(w.body[k].force, 0)
    for n in range(c.body[k].modes):
        P_fr, z, pivot = vec6(w.pfr[k, n], 0), w.zf[k, n], D[n, n]
        floor = SINGULAR * pivot  # relative to the diagonal before elimination: independent of the modes' units
        for i in range(n):
            s = -w.inverse_pivot[k, i] * D[i, n]
            factor[i] = s
            pivot += s * D[i, n]
            z += s * w.pfr[k, i, LOAD]
            P_fr = axpy6(s, vec6(w.pfr[k, i], 0), P_fr)
        if not _keep_pivot(c, w, k, n, pivot, floor):
            return False
        for m in range(n + 1, c.body[k].modes):
            row = D[n, m]
            for i in range(n):
                row += factor[i] * D[i, m]
            D[n, m] = row
        store6(w.pfr[k, n], 0, P_fr)
        w.pfr[k, n, LOAD] = z
        s = -w.inverse_pivot[k, n]
        z_r = axpy6(s * z, P_fr, z_r)
        P = sum_inertia(P, outer_inertia(P_fr[0], P_fr[1], s))
    store6(w.body[k].hinge_force, 0, z_r)
    store_inertia(w.body[k].hinge_inertia, 0, P)
    return True


@helper
def _in_strips(c, w, k):
    """Right-looking elimination of [D_f P_fr z_f]: each row, once finished, is subtracted from all rows after it.

    For one scene of floats: the updates of different rows are independent of each other, so that vector instructions
    overlap. z_f is column LOAD of w.pfr, where each update of a row includes it at no cost.
    """
    D, Y, nm = w.pff[k], w.pfr[k], c.body[k].modes
    for n in range(nm):
        w.inverse_pivot[k, n] = SINGULAR * D[n, n]  # until the pivot is known, its least admissible value
        put(w, Y[n], 0, with_seventh(w, strip(w, Y[n], 0), w.zf[k, n]))
    taken = ZERO6
    for n in range(nm):
        if not _keep_pivot(c, w, k, n, D[n, n], w.inverse_pivot[k, n]):
            return False
        s, own = -w.inverse_pivot[k, n], strip(w, Y[n], 0)
        for i in range(n + 1, nm):
            factor = s * D[n, i]
            for m in range(start(w, i), nm, width(w)):
                put(w, D[i], m, strip(w, D[i], m) + factor * strip(w, D[n], m))
            put(w, Y[i], 0, strip(w, Y[i], 0) + factor * own)
        row = s * own
        loads = vec6(Y[n], 0)
        taken = axpy3(loads[0], row, taken[0]), axpy3(loads[1], row, taken[1])
    sums = w.point_mode
    put6(w, sums, 0, taken)
    P = column_inertia(sums)
    store6(w.body[k].hinge_force, 0, sum6(vec6(w.body[k].force, 0), column6(sums, LOAD)))
    store_inertia(w.body[k].hinge_inertia, 0, sum_inertia(load_inertia(w.body[k].inertia, 0), P))
    return True


@helper
def _keep_pivot(c, w, k, n, pivot, floor):
    """Store the pivot of mode n and its inverse; returns False if the pivot is NaN, or a rounding error."""
    sound = pivot.real > floor.real
    if not some(sound):
        return False
    pivot = kept(sound, pivot)
    note_mode(c, w, k, n, pivot)
    w.pff[k, n, n] = pivot
    w.inverse_pivot[k, n] = 1.0 / pivot
    return True


_eliminate = by_width(_in_strips, _one_by_one)


@helper
def about_hinge(c, w, k):
    """P_R (21,) and z_R (6,) of body k about O; in scenes without modes those of the body, whose origin is O."""
    if has(c, MODES):
        return w.body[k].hinge_inertia, w.body[k].hinge_force
    return w.body[k].inertia, w.body[k].force


@helper
def cholesky(a, n):
    """Lower Cholesky factor of a[:n,:n] in place; returns False if a is not positive definite to round-off, or NaN."""
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
    # P_fr is changed by -B'P_rr in two halves. With the first half, P_ff - P_fr B - B'P_rf contains half of B'P_rr B
    # from each of its products, as it should in all, and the new P_ff costs two products an element instead of three.
    P_rr = load_inertia(w.body[k].inertia, 0)
    for n in range(c.body[k].modes):
        _add_momentum(c, w, k, n, P_rr, -0.5)
    for n in range(c.body[k].modes):
        B, P_fr = from_hinge(c, w, k, n), vec6(w.pfr[k, n], 0)
        for m in range(n + 1):
            s = less6(w.pff[k, m, n], P_fr, from_hinge(c, w, k, m))
            w.pff[k, m, n] = s - dot6(B, vec6(w.pfr[k, m], 0))
    refer_coupling(c, w, k, -0.5)
    refer_rigid(c, w, k)


@helper
def from_hinge(c, w, k, n):
    """Column n of B: minus the velocity [angular; linear] of the body frame at unit speed of mode n, with O at rest."""
    i = c.body[k].outboard_port
    angular, linear = mode_motion(w, i, n)
    return angular, sub(linear, cross(angular, vec3(w.port[i].r, 0)))


@helper
def _add_momentum(c, w, k, n, P_rr, s):
    """P_fr += s B'P_rr, row n."""
    add6(w.pfr[k, n], 0, scale6(s, inertia_times(P_rr, from_hinge(c, w, k, n))))


@helper
def refer_coupling(c, w, k, s):
    """P_fr := (P_fr + s B'P_rr) X: the loads about O of unit modal accelerations."""
    back = scale(-1.0, vec3(w.port[c.body[k].outboard_port].r, 0))
    P_rr = load_inertia(w.body[k].inertia, 0)
    for n in range(c.body[k].modes):
        _add_momentum(c, w, k, n, P_rr, s)
        store6(w.pfr[k, n], 0, shift_force(vec6(w.pfr[k, n], 0), back))


@helper
def refer_rigid(c, w, k):
    """z_f := z_f - B'z_r, P_rr := X'P_rr X, z_r := X'z_r."""
    z_r = vec6(w.body[k].force, 0)
    for n in range(c.body[k].modes):
        w.zf[k, n] -= dot6(from_hinge(c, w, k, n), z_r)
    back = scale(-1.0, vec3(w.port[c.body[k].outboard_port].r, 0))
    store_inertia(w.body[k].inertia, 0, shift_inertia(load_inertia(w.body[k].inertia, 0), back))
    store6(w.body[k].force, 0, shift_force(z_r, back))


@helper
def to_parent(c, w, k, P, F, row):
    """Add P_R^+ and F = z_R^+ to the parent: P += A Gamma A', z += A z_R^+.

    Behind a hinge with a single axis and no armature P_R^+ has no inertia along the axis: row `row` of P_R^+ is zero,
    and its rotation skips it. For other hinges `row` is negative.
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
    """P = gamma + the constant inertia of the rigid body k.

    `sweeps.bodies` does not write the inertia of such a body: it is stored here once in place of stored, read and
    stored again.
    """
    own = c.body[k].rigid
    store_inertia(w.body[k].inertia, 0, add_rigid(gamma, own[0], vec3(own, 1), sym6(own, 4)))


@helper
def inertia_to_parent(c, w, k, P):
    """P += A Gamma A' of the parent; Gamma is P in the parent's axes about the parent's origin or inboard port."""
    _add_inertia(c, w, k, shift_inertia(rotate_inertia(mat3(w.body[k].rotation, 0), P), vec3(w.body[k].arm, 0)))


@helper
def force_to_parent(c, w, z, k, F):
    """Add A F to the parent's force in z: the workspace w itself, or a `Response` to the factors in w."""
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
    """Add Pi' Gamma Pi to the upper triangle of P_ff and phi Gamma Pi to P_fr, for port i of body k at position r."""
    nm, modes, momenta = c.body[k].modes, w.port_mode[i], w.point_mode
    for n in range(0, nm, width(w)):
        momentum = inertia_times(gamma, strips6(w, modes, n))
        put6(w, momenta, n, momentum)
        add_across(w, w.pfr[k], n, shift_force(momentum, r))
        for m in range(n, min(n + width(w), nm)):
            for j in range(n, nm, width(w)):
                row = plus6(strip(w, w.pff[k, m], j), column6(momenta, m), strips6(w, modes, j))
                put(w, w.pff[k, m], j, row)


@helper
def _add_force(c, w, z, k, F_parent):
    """z += A F with A = [Pi'; phi] of body k's inboard port on the parent; F is about this port, in parent axes."""
    parent, i = c.body[k].parent, c.body[k].inboard_port
    if has(c, INBOARD_NODES) and i >= 0:
        add_port_force(c, w, z, parent, i, F_parent)
    else:
        add6(z.body[parent].force, 0, F_parent)


@helper
def modal_accelerations(c, w, k, A):
    """Back substitution L' etadd = -D^-1 L^-1 (z_f + P_fr A) with the acceleration A of O: outward half of (64)."""
    nm = c.body[k].modes
    for n in range(nm - 1, -1, -1):
        s = plus6(w.pfr[k, n, LOAD], vec6(w.pfr[k, n], 0), A)
        for i in range(n + 1, nm):
            s += w.pff[k, n, i] * w.etadd[k, i]
        w.etadd[k, n] = -w.inverse_pivot[k, n] * s
        w.speed[c.body[k].etad_index + n].acceleration = w.etadd[k, n]
