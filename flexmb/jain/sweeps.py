"""Articulated-body forward dynamics of trees with rigid and flexible bodies, O(N): Jain & Rodriguez (63), (64).

Per body the modes are eliminated first, by one of `flexmb.jain.variants`, then the hinge. Every quantity is a scalar
tuple or a row of the workspace. Bodies are numbered base to tip, hence the inward sweep runs from N-1 to 0. Gravity
enters as acceleration -g of the ground.
"""

from flexmb.hinges.catalogue import PRISMATIC, REVOLUTE
from flexmb.jain.doubt import note_hinge
from flexmb.jain.explicit import cholesky
from flexmb.jain.forces import elastic_forces, node_loads
from flexmb.jain.kinematics import (
    inboard_acceleration,
    motion_column,
    port_acceleration,
    pose_sweep,
    store_body_acceleration,
    velocity_sweep,
)
from flexmb.jain.variants import eliminate_modes, inertia, modal_accelerations, to_parent
from flexmb.jain.wheels import wheel_forces
from flexmb.jit.kernel import helper
from flexmb.levels.range import is_out_of_range
from flexmb.motion.coordinates import hinge_forces
from flexmb.spatial.inertia import (
    inertia_column,
    inertia_times,
    load_inertia,
    outer_inertia,
    sum_inertia,
)
from flexmb.spatial.pivots import is_rounding, is_small
from flexmb.spatial.vector import add, add3, dot, mat3, scale, store3, times, vec3
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK, OUT_OF_RANGE

SINGLE = -1  # free_count of a hinge with one free speed along z: no small matrices


@helper
def forward_dynamics(c, w):
    """Accelerations udot into w.speed.acceleration from the state in w.q, w.u; returns a status code."""
    status = bodies(c, w)
    if status != OK:
        return status
    if not inward(c, w):
        return NOT_POSITIVE_DEFINITE
    outward(c, w)
    return OK


@helper
def bodies(c, w):
    """Motion, inertia and forces of all bodies by themselves, before any is eliminated; returns a status code."""
    hinge_forces(c, w)
    velocity_sweep(c, w, False, False)
    if c.load.shape[0] > 0:
        pose_sweep(c, w)
    for k in range(c.body.shape[0]):
        if is_out_of_range(c, w, k):
            w.fault[0] = k
            return OUT_OF_RANGE
        inertia(c, w, k)
        elastic_forces(c, w, k)
        node_loads(c, w, k)
        wheel_forces(c, w, k)
    return OK


@helper
def inward(c, w):
    """The inward half of (63), (64); False where a D is not positive definite, w.fault names the body.

    w.doubt says whether a pivot was so small that it may be rounding. What is left of M_m are the factors that
    `flexmb.jain.innovations` solves with.
    """
    w.doubt[0] = 0
    for k in range(c.body.shape[0] - 1, -1, -1):
        if not (eliminate_modes(c, w, k) and _eliminate_hinge(c, w, k)):
            w.fault[0] = k
            return False
    return True


@helper
def _eliminate_hinge(c, w, k):
    """D_R, G_R, P_R^+ and z_R^+ of (63), (64), handed to the parent. Prescribed speeds act as bias, not as freedom."""
    p = load_inertia(w.body[k].hinge_inertia, 0)
    kind = c.body[k].hinge_kind
    j = c.body[k].u_index
    single = kind in (REVOLUTE, PRISMATIC) and c.body[k].outboard_port < 0
    impose(c, w, k)
    moved = inertia_times(p, (vec3(w.body[k].bias, 0), vec3(w.body[k].bias, 3)))
    tau = add(vec3(w.body[k].hinge_force, 0), moved[0])
    f = add(vec3(w.body[k].hinge_force, 3), moved[1])
    if single and c.speed[j].prescribed < 0:
        # the axis is z: H picks one row
        row = 2 if kind == REVOLUTE else 5
        u_angular, u_linear = inertia_column(p, row)
        d = u_angular[2] if kind == REVOLUTE else u_linear[2]
        before = w.body[k].inertia[2 if kind == REVOLUTE else 17]
        if is_small(c, w, j, d, before) and is_rounding(d, before):
            return False
        epsilon = w.speed[j].applied - (tau[2] if kind == REVOLUTE else f[2])
        s = 1.0 / d
        w.body[k].free_count = SINGLE
        w.body[k].hinge_factor[0, 0] = d
        w.body[k].hinge_residual[0] = epsilon * s
        store3(w.body[k].hinge_gain[0], 0, scale(s, u_angular))
        store3(w.body[k].hinge_gain[0], 3, scale(s, u_linear))
        tau = add(tau, scale(epsilon * s, u_angular))
        f = add(f, scale(epsilon * s, u_linear))
        if c.body[k].parent >= 0:
            to_parent(c, w, k, sum_inertia(p, outer_inertia(u_angular, u_linear, -s)), (tau, f))
        return True
    return _eliminate_several(c, w, k, p, tau, f)


@helper
def impose(c, w, k):
    """Rates of the hinge's prescribed speeds, added to the bias."""
    j = c.body[k].u_index
    for n in range(c.body[k].nv):
        f = c.speed[j + n].prescribed
        if f >= 0:
            angular, linear = motion_column(c, w, k, n)
            w.speed[j + n].acceleration = w.function[f, 2]
            add3(w.body[k].bias, 0, scale(w.function[f, 2], angular))
            add3(w.body[k].bias, 3, scale(w.function[f, 2], linear))


@helper
def find_free(c, w, k):
    """The hinge's free speeds into w.body[k].free_speed; returns how many there are."""
    free = 0
    for n in range(c.body[k].nv):
        if c.speed[c.body[k].u_index + n].prescribed < 0:
            w.body[k].free_speed[free] = n
            free += 1
    w.body[k].free_count = free
    return free


@helper
def _eliminate_several(c, w, k, p, tau, f):
    """The general hinge: D_R = L L' over its free speeds; gains are kept as L^-1 (P_R H)'."""
    j = c.body[k].u_index
    free = find_free(c, w, k)
    D = w.body[k].hinge_factor
    G = w.body[k].hinge_gain
    for a in range(free):
        n = w.body[k].free_speed[a]
        angular, linear = motion_column(c, w, k, n)
        u_angular, u_linear = inertia_times(p, (angular, linear))
        store3(G[a], 0, u_angular)
        store3(G[a], 3, u_linear)
        w.body[k].hinge_residual[a] = w.speed[j + n].applied - dot(angular, tau) - dot(linear, f)
        for b in range(a + 1):
            angular_b, linear_b = motion_column(c, w, k, w.body[k].free_speed[b])
            D[a, b] = dot(u_angular, angular_b) + dot(u_linear, linear_b)
    if not cholesky(D, free):
        return False
    note_hinge(c, w, k, D, 0)
    for a in range(free):
        for b in range(a):
            w.body[k].hinge_residual[a] -= D[a, b] * w.body[k].hinge_residual[b]
            for i in range(6):
                G[a, i] -= D[a, b] * G[b, i]
        s = 1.0 / D[a, a]
        w.body[k].hinge_residual[a] *= s
        for i in range(6):
            G[a, i] *= s
        u_angular, u_linear = vec3(G[a], 0), vec3(G[a], 3)
        p = sum_inertia(p, outer_inertia(u_angular, u_linear, -1.0))
        tau = add(tau, scale(w.body[k].hinge_residual[a], u_angular))
        f = add(f, scale(w.body[k].hinge_residual[a], u_linear))
    if c.body[k].parent >= 0:
        to_parent(c, w, k, p, (tau, f))
    return True


@helper
def outward(c, w):
    """Outward half of (64): udot, modal accelerations, loads across hinges, drive loads, wheel accelerations."""
    for k in range(c.body.shape[0]):
        alpha, a = inboard_acceleration(c, w, k)
        alpha, a = _hinge_acceleration(c, w, k, alpha, a)
        modal_accelerations(c, w, k, (alpha, a))
        store_body_acceleration(c, w, k, (alpha, a))
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            wheel_acceleration(c, w, k, i)


@helper
def _hinge_acceleration(c, w, k, alpha, a):
    """Rates of the hinge's free speeds from alpha^+ = Phi' alpha_m; returns alpha^+ + H udot + a_m."""
    j = c.body[k].u_index
    free = w.body[k].free_count
    G = w.body[k].hinge_gain
    full_alpha = add(alpha, vec3(w.body[k].bias, 0))
    full_a = add(a, vec3(w.body[k].bias, 3))
    if free == SINGLE:
        rate = w.body[k].hinge_residual[0] - dot(vec3(G[0], 0), alpha) - dot(vec3(G[0], 3), a)
        w.speed[j].acceleration = rate
        if c.body[k].hinge_kind == REVOLUTE:
            return (full_alpha[0], full_alpha[1], full_alpha[2] + rate), full_a
        return full_alpha, (full_a[0], full_a[1], full_a[2] + rate)
    D = w.body[k].hinge_factor
    for n in range(free - 1, -1, -1):
        s = w.body[k].hinge_residual[n] - dot(vec3(G[n], 0), alpha) - dot(vec3(G[n], 3), a)
        for i in range(n + 1, free):
            s -= D[i, n] * w.speed[j + w.body[k].free_speed[i]].acceleration
        w.speed[j + w.body[k].free_speed[n]].acceleration = s / D[n, n]
    for n in range(free):
        angular, linear = motion_column(c, w, k, w.body[k].free_speed[n])
        rate = w.speed[j + w.body[k].free_speed[n]].acceleration
        full_alpha = add(full_alpha, scale(rate, angular))
        full_a = add(full_a, scale(rate, linear))
    return full_alpha, full_a


@helper
def wheel_acceleration(c, w, k, i):
    """I (thetadd + q . alpha_node) = torque: the rate of a free wheel."""
    j = c.wheel[i].u_index
    f = c.speed[j].prescribed
    if f >= 0:
        w.speed[j].acceleration = w.function[f, 2]
        return
    port = c.wheel[i].port
    axis = times(mat3(w.port[port].R, 0), vec3(c.wheel[i].axis, 0))
    alpha, _ = port_acceleration(c, w, k, port)
    w.speed[j].acceleration = w.speed[j].applied / c.wheel[i].axial - dot(axis, alpha)
