"""Composite-body inertias and the mass matrix of trees: Jain & Rodriguez (47)-(50), O(N^2 n^2); forward dynamics (46).

R(k) is the modal inertia of body k and of all bodies that it carries, rigidly attached to it. A unit rate of a speed of
body k needs the force X = R H'. It is passed inward through the bodies that carry k, and its projections on the motions
of their speeds are the elements of M (50). A body passes on the forces of all speeds that it carries in one loop over
contiguous columns, for which M has the depth-first order of `flexmb.jain.places` in place of that of u.

A wheel is one more speed of its body, whose force is the torque I q on its node. The armature of a hinge's speed is
inertia along this speed alone: it is on the diagonal of M.
"""

from flexmb.jain import inverse
from flexmb.jain.explicit import inertia_to_parent, refer_to_hinge
from flexmb.jain.kinematics import motion_column, velocity_sweep
from flexmb.jain.ports import mode_motion
from flexmb.jain.wheels import spin_axis
from flexmb.jit.features import has
from flexmb.jit.kernel import helper, kernel
from flexmb.levels.body import body_inertia
from flexmb.levels.range import is_out_of_range
from flexmb.motion.coordinates import hinge_forces
from flexmb.spatial.inertia import inertia_times, load_inertia
from flexmb.spatial.linear_algebra import cholesky_rows, cholesky_solve
from flexmb.spatial.pivots import is_small
from flexmb.spatial.rows import column3
from flexmb.spatial.spatial_vector import vec6
from flexmb.spatial.vector import dot, mat3, scale, vec3
from flexmb.tables.features import ARMATURES
from flexmb.tables.status import NOT_POSITIVE_DEFINITE, OK, OUT_OF_RANGE

TILE = 16


@helper
def mass_matrix(c, w, m):
    """Write the upper triangle of M at the configuration in w.q to m.M, in depth-first order."""
    for j in range(w.u.shape[0]):
        w.u[j] = 0.0  # the kernels below compute bias forces too, which are not needed here
    velocity_sweep(c, w, False, False)
    for k in range(c.body.shape[0]):
        body_inertia(c, w, k)
    composite_bodies(c, w, m)


@kernel
def forward_dynamics(c, w, m):
    """Accelerations to w.speed.acceleration by (46), drive loads to w.speed.drive; returns a status code.

    Inverse dynamics with zero rates of the free speeds gives the bias; the given rates of the prescribed speeds are
    part of it. m keeps M, the bias and the factor.
    """
    hinge_forces(c, w)
    for j in range(w.u.shape[0]):
        f = c.speed[j].prescribed
        w.speed[j].acceleration = w.function[f, 2] if f >= 0 else 0.0
    status = inverse.inverse_dynamics(c, w, m.bias)
    if status != OK:
        return status
    for k in range(c.body.shape[0]):
        if is_out_of_range(c, w.eta[k], k):
            w.fault[0] = k
            return OUT_OF_RANGE
    composite_bodies(c, w, m)
    return _solve(c, w, m)


@helper
def _solve(c, w, m):
    """Solve M x = T - C for the free speeds.

    The order tips first keeps the zeros of M between branches out of the factor's fill-in, and its pivots are those of
    the articulated-body elimination, so that `flexmb.spatial.pivots` judges both alike.
    """
    free = m.x.shape[0]
    _reverse(m, free)
    for a in range(free):
        j = m.speed[m.order[a]]
        m.x[a] = w.speed[j].applied - m.bias[j]
    failed = cholesky_rows(m.U, free)
    if failed >= 0:
        w.fault[0] = m.body[m.order[failed]]
        return NOT_POSITIVE_DEFINITE
    w.doubt[0] = 0
    for a in range(free):
        i = m.order[a]
        is_small(c, w, m.speed[i], m.U[a, a] * m.U[a, a], m.M[i, i])
    cholesky_solve(m.U, m.x, free)
    for a in range(free):
        w.speed[m.speed[m.order[a]]].acceleration = m.x[a]
    for b in range(free, m.order.shape[0]):  # drive loads: the rows of M of the prescribed speeds
        i = m.order[b]
        j = m.speed[i]
        load = m.bias[j] - w.speed[j].applied
        for a in range(free):
            e = m.order[a]
            load += m.M[min(i, e), max(i, e)] * m.x[a]
        w.speed[j].drive = load
    return OK


@helper
def _reverse(m, n):
    """Copy M of the free speeds to the upper triangle of U, tips first.

    The reversed order makes this a transposition, done by tiles of TILE x TILE numbers that fit the first cache.
    """
    for a0 in range(0, n, TILE):
        for b0 in range(a0, n, TILE):
            for b in range(b0, min(b0 + TILE, n)):
                row = m.M[m.order[b]]
                for a in range(a0, min(a0 + TILE, b + 1)):
                    m.U[a, b] = row[m.order[a]]


@kernel
def composite_bodies(c, w, m):
    """R(k) = Phi R(k-1) Phi' + M_m (47), X(k) = R(k) H' and the rows of M of body k (50), from tips to base.

    Needs M_m of all bodies in w.body.inertia, w.pff and w.pfr, and overwrites it by R.
    """
    for k in range(c.body.shape[0] - 1, -1, -1):
        if c.body[k].outboard_port >= 0:
            refer_to_hinge(c, w, k)
            _forces_to_hinge(c, w, m, k)
        _own_forces(c, w, m, k)
        _hinge_rows(c, w, m, k)
        if c.body[k].parent >= 0:
            inertia_to_parent(c, w, k, load_inertia(w.body[k].inertia, 0))
            _forces_to_parent(c, w, m, k)


@helper
def _own_forces(c, w, m, k):
    """X of body k's own speeds about O to their columns of m.X; the block of M of its modes and wheels."""
    first, modes, wheels = m.hinge[k], m.modes[k], m.wheels[k]
    R = load_inertia(w.body[k].inertia, 0)
    for n in range(c.body[k].nv):
        _store_force(m.X, first + n, inertia_times(R, motion_column(c, w, k, n)))
    nm = c.body[k].modes
    for n in range(nm):
        _store_force(m.X, modes + n, vec6(w.pfr[k, n], 0))
        for i in range(n, nm):
            m.M[modes + n, modes + i] = w.pff[k, n, i]
    count = c.body[k].wheel_stop - c.body[k].wheel_start
    for i in range(count):
        wheel = c.body[k].wheel_start + i
        port, axial = c.wheel[wheel].port, c.wheel[wheel].axial
        torque = scale(axial, spin_axis(c, w, wheel))
        _store_force(m.X, wheels + i, (torque, (0.0, 0.0, 0.0)))
        out = c.body[k].outboard_port
        for n in range(nm):
            row = dot(column3(w.port_mode[port], 0, n), torque)
            if out >= 0:
                row -= dot(column3(w.port_mode[out], 0, n), torque)
            m.M[modes + n, wheels + i] = row
        m.M[wheels + i, wheels + i] = axial


@helper
def _hinge_rows(c, w, m, k):
    """M(k, j) = H X(j) for the hinge's speeds and all speeds j that the hinge carries; armatures on the diagonal."""
    for n in range(c.body[k].nv):
        place = m.hinge[k] + n
        _project(motion_column(c, w, k, n), m.X, m.M[place], place, m.stop[k])
        if has(c, ARMATURES):
            m.M[place, place] += c.speed[c.body[k].u_index + n].armature


@helper
def _forces_to_hinge(c, w, m, k):
    """Refer the forces of all that body k carries from its origin to O, where O sits on a node that deforms.

    The modes of the body receive -[Pi_d]' X (45), because O moves against the body with them.
    """
    i, start, stop = c.body[k].outboard_port, m.carried[k], m.stop[k]
    _shift(scale(-1.0, vec3(w.port[i].r, 0)), m.X, start, stop)
    for n in range(c.body[k].modes):
        _project_off(mode_motion(w, i, n), m.X, m.M[m.modes[k] + n], start, stop)


@helper
def _forces_to_parent(c, w, m, k):
    """X(j) = Phi X(j-1) for all speeds that hinge k carries, and the rows [Pi_t]' X of the parent's modes."""
    p, i = c.body[k].parent, c.body[k].inboard_port
    start, stop = m.hinge[k], m.stop[k]
    _rotate(mat3(w.body[k].rotation, 0), m.X, start, stop)
    _shift(vec3(w.body[k].arm, 0), m.X, start, stop)
    if i >= 0:
        for n in range(c.body[p].modes):
            _project(mode_motion(w, i, n), m.X, m.M[m.modes[p] + n], start, stop)
        _shift(vec3(w.port[i].r, 0), m.X, start, stop)
    else:
        for n in range(c.body[p].modes):
            for j in range(start, stop):
                m.M[m.modes[p] + n, j] = 0.0


@helper
def _store_force(X, j, F):
    """Store F = (torque, force) in column j of X."""
    tau, f = F
    for i in range(3):
        X[i, j] = tau[i]
        X[3 + i, j] = f[i]


@helper
def _project(V, X, row, start, stop):
    """row = V' X in columns start .. stop."""
    angular, linear = V
    a, b, c, d, e, f = X[0], X[1], X[2], X[3], X[4], X[5]
    for j in range(start, stop):
        row[j] = (
            angular[0] * a[j] + angular[1] * b[j] + angular[2] * c[j]
            + linear[0] * d[j] + linear[1] * e[j] + linear[2] * f[j]
        )  # fmt: skip


@helper
def _project_off(V, X, row, start, stop):
    """row -= V' X in columns start .. stop."""
    angular, linear = V
    a, b, c, d, e, f = X[0], X[1], X[2], X[3], X[4], X[5]
    for j in range(start, stop):
        row[j] -= (
            angular[0] * a[j] + angular[1] * b[j] + angular[2] * c[j]
            + linear[0] * d[j] + linear[1] * e[j] + linear[2] * f[j]
        )  # fmt: skip


@helper
def _rotate(R, X, start, stop):
    """Torques and forces in columns start .. stop of X turned by R."""
    _rotate3(R, X[0], X[1], X[2], start, stop)
    _rotate3(R, X[3], X[4], X[5], start, stop)


@helper
def _rotate3(R, x, y, z, start, stop):
    """Vectors with components in rows x, y, z turned by R."""
    for j in range(start, stop):
        a, b, c = x[j], y[j], z[j]
        x[j] = R[0] * a + R[1] * b + R[2] * c
        y[j] = R[3] * a + R[4] * b + R[5] * c
        z[j] = R[6] * a + R[7] * b + R[8] * c


@helper
def _shift(d, X, start, stop):
    """phi X: refer torques to another point; d is the vector from that point to the one they were about."""
    a, b, c, x, y, z = X[0], X[1], X[2], X[3], X[4], X[5]
    for j in range(start, stop):
        a[j] += d[1] * z[j] - d[2] * y[j]
        b[j] += d[2] * x[j] - d[0] * z[j]
        c[j] += d[0] * y[j] - d[1] * x[j]
