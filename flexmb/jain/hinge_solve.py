"""The hinge of one body in the sweeps, by the factor of D_R = L L', with a faster form for hinges with a single axis.

P_R and z_R are the articulated inertia and force of body k about O after its modes are eliminated; the rows of H are
the motions of the hinge's free speeds. With epsilon = T - H z_R and G = P_R H' D_R^-1, Jain & Rodriguez (63), (64),
`eliminate` stores G L = P_R H' L'^-1, L and L^-1 epsilon as `gain`, `factor` and `residual` in w.hinge. `accelerate`
is the outward half. The other functions solve with the same factors for a `Response`:

    innovate      y = L^-1 (T - H z)               z^+ = z + G L y            inward   (55)
    solve         x = L'^-1 (y - (G L)'alpha^+)    alpha = alpha^+ + H' x     outward  (56)
    synthesise    T = L y + H z                    z^+ = z + G L y            inward, undoes `innovate`
    excite        y = L' x + (G L)'alpha^+         alpha = alpha^+ + H' x     outward, undoes `solve`

The armatures J of the hinge's speeds, which the paper does not have, enter D_R = H P_R H' + J and nothing else: the
rotor turns with its own speed only, so that what the parent feels of it is in G.

The response holds T, y and x in one array `speed`, in which each overwrites the one it is computed from. H has no rows
for prescribed speeds, which are zero in y and x.

A hinge with a single axis has one free speed, along z: H selects a row, and D_R is a number. For such a hinge G, D_R
and D_R^-1 epsilon are stored in w.body, so that forward dynamics takes no square root.
"""

from math import log

from flexmb.jain.axis import along, move_along, turns
from flexmb.jain.doubt import note_hinge
from flexmb.jain.explicit import about_hinge, cholesky
from flexmb.jain.kinematics import motion_column
from flexmb.jain.variants import to_parent
from flexmb.jit.duals import nonzero
from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.jit.lanes import kept, some
from flexmb.spatial.inertia import inertia_column, inertia_times, less_outer, load_inertia, outer_inertia, sum_inertia
from flexmb.spatial.pivots import is_inertia, is_small
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.spatial_vector import add6, axpy6, dot6, less6, scale6, store6, sum6, vec6
from flexmb.tables.arrays import ANGULAR_Z, LINEAR_Z, NO_AXIS
from flexmb.tables.features import ARMATURES, PRESCRIBED, SEVERAL

SINGLE = -1  # in `free_count`: the hinge was eliminated by its single axis, and w.hinge was not written


@helper
def impose(c, w, k):
    """Set the rates of the hinge's prescribed speeds and add their accelerations of O to the bias."""
    j = c.body[k].u_index
    for n in range(c.body[k].nv):
        f = c.speed[j + n].prescribed
        if f >= 0:
            w.speed[j + n].acceleration = w.function[f, 2]
            add6(w.body[k].bias, 0, scale6(w.function[f, 2], motion_column(c, w, k, n)))


@helper
def find_free(c, w, k):
    """Write the numbers of the hinge's free speeds to w.hinge[k].free_speed; returns their count."""
    free = 0
    for n in range(c.body[k].nv):
        if c.speed[c.body[k].u_index + n].prescribed < 0:
            w.hinge[k].free_speed[free] = n
            free += 1
    w.body[k].free_count = free
    return free


@helper
def eliminate(c, w, k):
    """D_R, G_R and epsilon_R of (63), (64); adds P_R^+ and z_R^+ to the parent. Returns whether D_R > 0.

    Prescribed speeds contribute to the bias only. Needs P_R and z_R of body k.
    """
    if has(c, PRESCRIBED):
        impose(c, w, k)
    P_R, z_R = about_hinge(c, w, k)
    P = load_inertia(P_R, 0)
    # The bias acceleration a_m of O meets the inertia P_R, which the modes have left: z_R + P_R a_m.
    z = sum6(vec6(z_R, 0), inertia_times(P, vec6(w.body[k].bias, 0)))
    j = c.body[k].u_index
    if has(c, SEVERAL) and (c.body[k].axis < 0 or c.body[k].outboard_port >= 0 or c.speed[j].prescribed >= 0):
        return _eliminate_several(c, w, k, P, z)
    # A single free axis is z of the hinge's axes: H selects one row, and no product with H is computed.
    row = ANGULAR_Z if turns(c, k) else LINEAR_Z
    PH = inertia_column(P, row)
    D = along(c, k, PH)
    before = w.body[k].inertia[2 if turns(c, k) else 17]  # diagonal of this row before the modes were eliminated
    if has(c, ARMATURES):
        D += c.speed[j].armature
        before += c.speed[j].armature
    if is_small(c, w, j, D, before):
        sound = is_inertia(D, before)
        if not some(sound):
            return False
        D = kept(sound, D)
    epsilon = w.speed[j].applied - along(c, k, z)
    s = 1.0 / D
    w.body[k].free_count = SINGLE
    w.body[k].inertia_along = D
    w.body[k].rate_at_rest = epsilon * s
    G = scale6(s, PH)
    store6(w.body[k].gain, 0, G)
    if c.body[k].parent >= 0:
        if has(c, ARMATURES) and some(nonzero(c.speed[j].armature)):
            row = NO_AXIS  # P_R^+ keeps inertia along the axis, in series with the armature
        to_parent(c, w, k, less_outer(P, G, PH), axpy6(epsilon, G, z), row)
    return True


@helper
def _eliminate_several(c, w, k, P, z):
    """`eliminate` for hinges with several or prescribed speeds, or with O on a deforming node.

    P^+ and z^+ are updated by one column of G L after the other: P - (G L)(G L)', z + (G L) L^-1 epsilon.
    """
    free = find_free(c, w, k)
    D, G, residual = w.hinge[k].factor, w.hinge[k].gain, w.hinge[k].residual
    for a in range(free):
        n = w.hinge[k].free_speed[a]
        H = motion_column(c, w, k, n)
        PH = inertia_times(P, H)
        store6(G[a], 0, PH)
        residual[a] = less6(w.speed[c.body[k].u_index + n].applied, H, z)
        for b in range(a + 1):
            D[a, b] = dot6(PH, motion_column(c, w, k, w.hinge[k].free_speed[b]))
        if has(c, ARMATURES):
            D[a, a] += c.speed[c.body[k].u_index + n].armature
    if not cholesky(D, free):
        return False
    note_hinge(c, w, k, D, 0)
    # With D_R = L L', forward substitution turns epsilon into L^-1 epsilon and P H' into P H' L'^-1 = G L.
    for a in range(free):
        for b in range(a):
            residual[a] -= D[a, b] * residual[b]
            for i in range(6):
                G[a, i] -= D[a, b] * G[b, i]
        s = 1.0 / D[a, a]
        residual[a] *= s
        for i in range(6):
            G[a, i] *= s
        GL = vec6(G[a], 0)
        P = sum_inertia(P, outer_inertia(GL[0], GL[1], -1.0))
        z = axpy6(residual[a], GL, z)
    if c.body[k].parent >= 0:
        to_parent(c, w, k, P, z, NO_AXIS)
    return True


@helper
def accelerate(c, w, k, A):
    """Rates of the free speeds from A = alpha^+; returns the acceleration alpha^+ + H' udot + a_m of O (64)."""
    j, free = c.body[k].u_index, w.body[k].free_count
    moved = sum6(A, vec6(w.body[k].bias, 0))
    if not has(c, SEVERAL) or free == SINGLE:
        udot = less6(w.body[k].rate_at_rest, vec6(w.body[k].gain, 0), A)
        w.speed[j].acceleration = udot
        return move_along(c, k, moved, udot)
    D, G = w.hinge[k].factor, w.hinge[k].gain
    # L' udot = L^-1 epsilon - (G L)' alpha^+, by back substitution from the last speed.
    for a in range(free - 1, -1, -1):
        udot = less6(w.hinge[k].residual[a], vec6(G[a], 0), A)
        for b in range(a + 1, free):
            udot -= D[b, a] * w.speed[j + w.hinge[k].free_speed[b]].acceleration
        w.speed[j + w.hinge[k].free_speed[a]].acceleration = udot / D[a, a]
    for a in range(free):
        n = w.hinge[k].free_speed[a]
        moved = axpy6(w.speed[j + n].acceleration, motion_column(c, w, k, n), moved)
    return moved


@helper
def add_innovations(c, w, x, k):
    """Add generalised forces to those that `eliminate` has seen; x.speed holds their innovations y."""
    j = c.body[k].u_index
    if not has(c, SEVERAL) or w.body[k].free_count == SINGLE:
        w.body[k].rate_at_rest += x.speed[j] / sqrt(w.body[k].inertia_along)
        return
    for a in range(w.body[k].free_count):
        w.hinge[k].residual[a] += x.speed[j + w.hinge[k].free_speed[a]]


@helper
def innovate(c, w, x, k, z):
    """T := y = L^-1 (T - H z); returns z^+ (55)."""
    j, free = c.body[k].u_index, w.body[k].free_count
    if not has(c, SEVERAL) or free == SINGLE:
        epsilon = x.speed[j] - along(c, k, z)
        x.speed[j] = epsilon / sqrt(w.body[k].inertia_along)
        return axpy6(epsilon, vec6(w.body[k].gain, 0), z)
    D = w.hinge[k].factor
    _hold(c, x, k)
    for a in range(free):
        n = w.hinge[k].free_speed[a]
        epsilon = less6(x.speed[j + n], motion_column(c, w, k, n), z)
        for b in range(a):
            epsilon -= D[a, b] * x.speed[j + w.hinge[k].free_speed[b]]
        x.speed[j + n] = epsilon / D[a, a]
    return _gained(c, w, x, k, z)


@helper
def synthesise(c, w, x, k, z):
    """y := T = L y + H z; returns z^+ (54)."""
    j, free = c.body[k].u_index, w.body[k].free_count
    if not has(c, SEVERAL) or free == SINGLE:
        epsilon = sqrt(w.body[k].inertia_along) * x.speed[j]
        x.speed[j] = epsilon + along(c, k, z)
        return axpy6(epsilon, vec6(w.body[k].gain, 0), z)
    D = w.hinge[k].factor
    gained = _gained(c, w, x, k, z)
    for a in range(free - 1, -1, -1):
        n = w.hinge[k].free_speed[a]
        T = dot6(motion_column(c, w, k, n), z)
        for b in range(a + 1):
            T += D[a, b] * x.speed[j + w.hinge[k].free_speed[b]]
        x.speed[j + n] = T
    _hold(c, x, k)
    return gained


@helper
def solve(c, w, x, k, A):
    """y := x = L'^-1 (y - (G L)'alpha^+); returns alpha^+ + H' x (56)."""
    j, free = c.body[k].u_index, w.body[k].free_count
    if not has(c, SEVERAL) or free == SINGLE:
        rate = less6(x.speed[j] / sqrt(w.body[k].inertia_along), vec6(w.body[k].gain, 0), A)
        x.speed[j] = rate
        return move_along(c, k, A, rate)
    D, G = w.hinge[k].factor, w.hinge[k].gain
    for a in range(free - 1, -1, -1):
        rate = less6(x.speed[j + w.hinge[k].free_speed[a]], vec6(G[a], 0), A)
        for b in range(a + 1, free):
            rate -= D[b, a] * x.speed[j + w.hinge[k].free_speed[b]]
        x.speed[j + w.hinge[k].free_speed[a]] = rate / D[a, a]
    _hold(c, x, k)
    return _spread(c, w, x, k, A)


@helper
def excite(c, w, x, k, A):
    """x := y = L' x + (G L)'alpha^+; returns alpha^+ + H' x."""
    j, free = c.body[k].u_index, w.body[k].free_count
    if not has(c, SEVERAL) or free == SINGLE:
        rate = x.speed[j]
        x.speed[j] = sqrt(w.body[k].inertia_along) * (rate + dot6(vec6(w.body[k].gain, 0), A))
        return move_along(c, k, A, rate)
    D, G = w.hinge[k].factor, w.hinge[k].gain
    spread = _spread(c, w, x, k, A)
    for a in range(free):
        total = dot6(vec6(G[a], 0), A)
        for b in range(a, free):
            total += D[b, a] * x.speed[j + w.hinge[k].free_speed[b]]
        x.speed[j + w.hinge[k].free_speed[a]] = total
    _hold(c, x, k)
    return spread


@helper
def log_determinant(c, w, k):
    """log det D_R."""
    if not has(c, SEVERAL) or w.body[k].free_count == SINGLE:
        return log(w.body[k].inertia_along)
    total = 0.0
    for a in range(w.body[k].free_count):
        total += 2.0 * log(w.hinge[k].factor[a, a])
    return total


@helper
def _hold(c, x, k):
    """Set the entries of the hinge's prescribed speeds to zero."""
    for j in range(c.body[k].u_index, c.body[k].u_index + c.body[k].nv):
        if c.speed[j].prescribed >= 0:
            x.speed[j] = 0.0


@helper
def _gained(c, w, x, k, z):
    """z^+ = z + G L y of a general hinge."""
    for a in range(w.body[k].free_count):
        y = x.speed[c.body[k].u_index + w.hinge[k].free_speed[a]]
        z = axpy6(y, vec6(w.hinge[k].gain[a], 0), z)
    return z


@helper
def _spread(c, w, x, k, A):
    """alpha^+ + H' x of a general hinge."""
    for a in range(w.body[k].free_count):
        n = w.hinge[k].free_speed[a]
        A = axpy6(x.speed[c.body[k].u_index + n], motion_column(c, w, k, n), A)
    return A
