"""Loads on closures passed inward through the articulated quantities, and the motion they cause passed outward.

With M = (1 + H Phi K) D (1 + H Phi K)', the loads f of closures on a tree at rest give the rates M^-1 J'f. The inward
pass gives x = D^-1/2 (1 - H Psi K) J'f, the outward pass (1 - H Psi K)' D^-1/2 x: Jain & Rodriguez (56), body by body,
with what `forward_dynamics` leaves in its workspace. Hence J M^-1 J' = B'B of unit loads, without M, and a load only
passes the bodies between its node and the ground.
"""

from math import sqrt

from flexmb.closure.tables import ON_GROUND, ROTATION
from flexmb.hinges.catalogue import REVOLUTE
from flexmb.jain.kinematics import motion_column
from flexmb.jain.sweeps import SINGLE
from flexmb.jit.kernel import helper
from flexmb.spatial.spatial_vector import shift_force
from flexmb.spatial.vector import add, add3, axpy, cross, dot, mat3, scale, store3, sub, times, times_t, vec3


@helper
def half_solve(c, w, cc, cw):
    """x of a unit load of every row into cw.half."""
    for i in range(cc.closure.shape[0]):
        start, stop = cc.closure[i].row_start, cc.closure[i].row_stop
        for j in range(cc.closure[i].path_start, cc.closure[i].path_stop):
            clear_body(c, cw, cc.path[j])
        for r in range(start, stop):
            for j in range(w.u.shape[0]):
                cw.half[r, j] = 0.0
            apply_unit_load(c, w, cc, cw, i, r)
        for j in range(cc.closure[i].path_start, cc.closure[i].path_stop):
            for r in range(start, stop):
                pass_inward(c, w, cw, cc.path[j], r - start, cw.half[r])


@helper
def clear_body(c, cw, k):
    for s in range(cw.force.shape[1]):
        for n in range(6):
            cw.force[k, s, n] = 0.0
        for n in range(c.body[k].modes):
            cw.modal[k, s, n] = 0.0


@helper
def clear_loads(c, cw):
    for k in range(c.body.shape[0]):
        clear_body(c, cw, k)


@helper
def apply_unit_load(c, w, cc, cw, i, r):
    """The unit load of row r of closure i, in the slot that is its number in the closure."""
    direction = vec3(cw.row[r].direction, 0)
    zero = (0.0, 0.0, 0.0)
    tau = direction if cc.row[r].type == ROTATION else zero
    f = zero if cc.row[r].type == ROTATION else direction
    apply_load(c, w, cc, cw, i, r - cc.closure[i].row_start, tau, f)


@helper
def apply_load(c, w, cc, cw, i, s, tau, f):
    """[tau; f] about B, A axes, of closure i: added to B, taken from A as the same wrench, in slot s."""
    p = vec3(cw.closure[i].position, 0)
    R = mat3(cw.closure[i].rotation, 0)
    at_port(c, w, cw, cc.side[i, 1], s, times_t(R, tau), times_t(R, f))
    at_port(c, w, cw, cc.side[i, 0], s, scale(-1.0, add(tau, cross(p, f))), scale(-1.0, f))


@helper
def at_port(c, w, cw, side, s, tau, f):
    """A load about a port in port axes, as a force on its body and modes."""
    k = side.body
    if k == ON_GROUND:
        return
    R = mat3(w.port[side.port].R, 0)
    tau, f = times(R, tau), times(R, f)
    for n in range(c.body[k].modes):
        column = w.port_mode[side.port, n]
        cw.modal[k, s, n] += dot(vec3(column.W, 0), tau) + dot(vec3(column.L, 0), f)
    tau, f = shift_force((tau, f), vec3(w.port[side.port].r, 0))
    add3(cw.force[k, s], 0, tau)
    add3(cw.force[k, s], 3, f)


@helper
def pass_inward(c, w, cw, k, s, x):
    """Modes and hinge of body k take their part x of the load in slot s; the rest goes on to the parent.

    Afterwards cw.force[k, s] is the load about O that modes have not taken.
    """
    nm, eta = c.body[k].modes, c.body[k].etad_index
    tau, f = _about_hinge(c, w, cw, k, s)
    for n in range(nm):
        part = cw.modal[k, s, n]
        for m in range(n):
            part -= w.pff[k, n, m] * x[eta + m]
        part /= w.pff[k, n, n]
        x[eta + n] = part
        tau = axpy(-part, vec3(w.mode[k, n].pfr, 0), tau)
        f = axpy(-part, vec3(w.mode[k, n].pfr, 3), f)
    store3(cw.force[k, s], 0, tau)
    store3(cw.force[k, s], 3, f)
    tau, f = _through_hinge(c, w, k, x, tau, f)
    _hand_on(c, w, cw, k, s, tau, f)


@helper
def project_inward(c, w, cw, k, s, T):
    """Rows T of J'f of body k's own speeds for the load in slot s; all of it goes on to the parent.

    Afterwards cw.force[k, s] is the load about O, body axes. w has the poses and the motions of the ports.
    """
    tau, f = _about_hinge(c, w, cw, k, s)
    store3(cw.force[k, s], 0, tau)
    store3(cw.force[k, s], 3, f)
    for n in range(c.body[k].modes):
        T[c.body[k].etad_index + n] = cw.modal[k, s, n]
    for n in range(c.body[k].nv):
        angular, linear = motion_column(c, w, k, n)
        T[c.body[k].u_index + n] = dot(angular, tau) + dot(linear, f)
    _hand_on(c, w, cw, k, s, tau, f)


@helper
def _about_hinge(c, w, cw, k, s):
    """The load in slot s about O; where O is on a node that deforms, modes feel the reaction to it."""
    tau, f = vec3(cw.force[k, s], 0), vec3(cw.force[k, s], 3)
    i = c.body[k].outboard_port
    if i >= 0:
        r = vec3(w.port[i].r, 0)
        for n in range(c.body[k].modes):
            angular = vec3(w.port_mode[i, n].W, 0)
            linear = sub(vec3(w.port_mode[i, n].L, 0), cross(angular, r))
            cw.modal[k, s, n] -= dot(angular, tau) + dot(linear, f)
        tau, f = shift_force((tau, f), scale(-1.0, r))
    return tau, f


@helper
def _hand_on(c, w, cw, k, s, tau, f):
    """A load about O of body k, added to those of its parent and of the parent's modes."""
    parent = c.body[k].parent
    if parent < 0:
        return
    R = mat3(w.body[k].rotation, 0)
    tau, f = shift_force((times(R, tau), times(R, f)), vec3(w.body[k].arm, 0))
    i = c.body[k].inboard_port
    if i >= 0:
        for n in range(c.body[parent].modes):
            column = w.port_mode[i, n]
            cw.modal[parent, s, n] += dot(vec3(column.W, 0), tau) + dot(vec3(column.L, 0), f)
        tau, f = shift_force((tau, f), vec3(w.port[i].r, 0))
    add3(cw.force[parent, s], 0, tau)
    add3(cw.force[parent, s], 3, f)


@helper
def pivot(c, w, k):
    """D_R of a hinge with one free speed along z: an element of P_R."""
    return w.body[k].hinge_inertia[2 if c.body[k].hinge_kind == REVOLUTE else 17]


@helper
def _through_hinge(c, w, k, x, tau, f):
    """x of the hinge's free speeds, in the first places of its speeds; returns what passes the hinge."""
    j, free, G = c.body[k].u_index, w.body[k].free_count, w.body[k].hinge_gain
    if free == SINGLE:
        along = tau[2] if c.body[k].hinge_kind == REVOLUTE else f[2]
        x[j] = along / sqrt(pivot(c, w, k))
        return axpy(-along, vec3(G[0], 0), tau), axpy(-along, vec3(G[0], 3), f)
    D = w.body[k].hinge_factor
    for n in range(free):
        angular, linear = motion_column(c, w, k, w.body[k].free_speed[n])
        part = dot(angular, tau) + dot(linear, f)
        for m in range(n):
            part -= D[n, m] * x[j + m]
        x[j + n] = part / D[n, n]
    for n in range(free):
        tau = axpy(-x[j + n], vec3(G[n], 0), tau)
        f = axpy(-x[j + n], vec3(G[n], 3), f)
    return tau, f


@helper
def pass_outward(c, w, cw, x, v):
    """v = (1 - H Psi K)' D^-1/2 x: the change of all speeds; prescribed ones do not change."""
    for k in range(c.body.shape[0]):
        alpha, a = _at_hinge(c, w, cw, k, v)
        alpha, a = _across_hinge(c, w, k, x, v, alpha, a)
        nm, eta = c.body[k].modes, c.body[k].etad_index
        for n in range(nm - 1, -1, -1):
            rate = x[eta + n] - dot(vec3(w.mode[k, n].pfr, 0), alpha) - dot(vec3(w.mode[k, n].pfr, 3), a)
            for m in range(n + 1, nm):
                rate -= w.pff[k, m, n] * v[eta + m]
            v[eta + n] = rate / w.pff[k, n, n]
        i = c.body[k].outboard_port
        if i >= 0:
            for n in range(nm):
                alpha = axpy(-v[eta + n], vec3(w.port_mode[i, n].W, 0), alpha)
                a = axpy(-v[eta + n], vec3(w.port_mode[i, n].L, 0), a)
            a = sub(a, cross(alpha, vec3(w.port[i].r, 0)))
        store3(cw.accel[k], 0, alpha)
        store3(cw.accel[k], 3, a)
        for i in range(c.body[k].wheel_start, c.body[k].wheel_stop):
            _wheel(c, w, k, i, v, alpha)


@helper
def _at_hinge(c, w, cw, k, v):
    """O as a point of the parent, in body axes."""
    p = c.body[k].parent
    if p < 0:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    R = mat3(w.body[k].rotation, 0)
    alpha, a = vec3(cw.accel[p], 0), vec3(cw.accel[p], 3)
    i = c.body[k].inboard_port
    if i >= 0:
        a = add(a, cross(alpha, vec3(w.port[i].r, 0)))
        for n in range(c.body[p].modes):
            rate = v[c.body[p].etad_index + n]
            alpha = axpy(rate, vec3(w.port_mode[i, n].W, 0), alpha)
            a = axpy(rate, vec3(w.port_mode[i, n].L, 0), a)
    return times_t(R, alpha), times_t(R, add(a, cross(alpha, vec3(w.body[k].arm, 0))))


@helper
def _across_hinge(c, w, k, x, v, alpha, a):
    """Speeds of the hinge into v; returns the motion of O on its outboard side."""
    j, free, G = c.body[k].u_index, w.body[k].free_count, w.body[k].hinge_gain
    for n in range(c.body[k].nv):
        v[j + n] = 0.0
    if free == SINGLE:
        rate = x[j] / sqrt(pivot(c, w, k)) - dot(vec3(G[0], 0), alpha) - dot(vec3(G[0], 3), a)
        v[j] = rate
        if c.body[k].hinge_kind == REVOLUTE:
            return (alpha[0], alpha[1], alpha[2] + rate), a
        return alpha, (a[0], a[1], a[2] + rate)
    D = w.body[k].hinge_factor
    for n in range(free - 1, -1, -1):
        rate = x[j + n] - dot(vec3(G[n], 0), alpha) - dot(vec3(G[n], 3), a)
        for m in range(n + 1, free):
            rate -= D[m, n] * v[j + w.body[k].free_speed[m]]
        v[j + w.body[k].free_speed[n]] = rate / D[n, n]
    for n in range(free):
        angular, linear = motion_column(c, w, k, w.body[k].free_speed[n])
        rate = v[j + w.body[k].free_speed[n]]
        alpha = axpy(rate, angular, alpha)
        a = axpy(rate, linear, a)
    return alpha, a


@helper
def _wheel(c, w, k, i, v, alpha):
    """A free wheel keeps its own spin: I (v + q . w_node) = 0."""
    j = c.wheel[i].u_index
    if c.speed[j].prescribed >= 0:
        v[j] = 0.0
        return
    port = c.wheel[i].port
    for n in range(c.body[k].modes):
        alpha = axpy(v[c.body[k].etad_index + n], vec3(w.port_mode[port, n].W, 0), alpha)
    axis = times(mat3(w.port[port].R, 0), vec3(c.wheel[i].axis, 0))
    v[j] = -dot(axis, alpha)
