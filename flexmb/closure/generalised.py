"""Closures as generalised forces J'f on the tree: for bodies of level `ruthless`, and for composite bodies.

In these two cases unit loads cannot pass through the articulated-body quantities. The inertia of a body of level
`ruthless` is that of the undeformed shape, but closures act on the deformed nodes: J, its rate and the loads belong to
the deformed shape, which has a workspace `seen` of its own, while M is unchanged. The composite-body algorithm provides
no articulated-body quantities, but a Cholesky factor of M. With M = F F' from either algorithm, the rows F^-1 J' take
the place of those that `half_solve` finds, and Lambda^-1 = J M^-1 J'.

The load of a hinge is the inertial load minus the constraint loads on everything that the hinge carries, about O in the
axes of the hinge: its components along the hinge's free motions are the loads of springs and motors.
"""

from flexmb.closure.factor import row_place, sum_rows
from flexmb.closure.rows import evaluate_rows
from flexmb.closure.unit_loads import apply_rows, apply_unit_load, write_columns
from flexmb.jain import composite, innovations
from flexmb.jain.accelerations import acceleration_sweep
from flexmb.jain.inverse import inverse_dynamics
from flexmb.jain.kinematics import pose_sweep, velocity_sweep
from flexmb.jain.places import Matrices
from flexmb.jain.response import clear, clear_body, read_speeds, write_speeds
from flexmb.jain.sweeps import forward_dynamics
from flexmb.jit.kernel import by_bundle, helper, kernel, sweep
from flexmb.motion.coordinates import load_state
from flexmb.spatial.spatial_vector import add6, times6, vec6
from flexmb.spatial.vector import mat3, matmul, transpose
from flexmb.tables.status import OK


@helper
def _by_recursion(route, c, w):
    return forward_dynamics(c, w)


@helper
def _by_composite_bodies(route, c, w):
    return composite.forward_dynamics(c, w, route)


@helper
def _half_by_recursion(response, s, i, x, at):
    """F^-1 T of T in cw.response.speed, Jain & Rodriguez (55); nonzero only for bodies on the path of closure i."""
    cc, g = s.cc, s.cc.closure[i].group
    for j in range(cc.group[g].column_start, cc.group[g].column_stop):
        response.speed[cc.column[j]] = s.cw.response.speed[cc.column[j]]
    for j in range(cc.closure[i].path_start, cc.closure[i].path_stop):
        clear_body(s.c, response, cc.path[j])
    for j in range(cc.closure[i].path_start, cc.closure[i].path_stop):
        innovations.innovate(s.c, s.w, response, cc.path[j])
    write_columns(cc, i, response, x, at)


@helper
def _half_by_composite_bodies(m, s, i, x, at):
    """U'^-1 T of the free speeds; the others are zero."""
    cc, T, n, U = s.cc, s.cw.step, m.x.shape[0], m.U
    g = cc.closure[i].group
    for j in range(T.shape[0]):
        T[j] = 0.0
    for j in range(cc.group[g].column_start, cc.group[g].column_stop):
        T[cc.column[j]] = s.cw.response.speed[cc.column[j]]
    for a in range(n):
        m.x[a] = T[m.speed[m.order[a]]]
    for j in range(T.shape[0]):
        T[j] = 0.0
    for a in range(n):
        m.x[a] /= U[a, a]
        for b in range(a + 1, n):
            m.x[b] -= U[a, b] * m.x[a]
    for a in range(n):
        T[m.speed[m.order[a]]] = m.x[a]
    for j in range(cc.group[g].column_start, cc.group[g].column_stop):
        x[at + j - cc.group[g].column_start] = T[cc.column[j]]


@helper
def _rest_by_recursion(x, c, w, y, v):
    """v = F'^-1 y, the outward half of (56)."""
    read_speeds(x, y)
    innovations.respond(c, w, x)
    write_speeds(x, v)


@helper
def _rest_by_composite_bodies(m, c, w, y, v):
    n, U = m.x.shape[0], m.U
    for j in range(v.shape[0]):
        v[j] = 0.0
    for a in range(n - 1, -1, -1):
        total = y[m.speed[m.order[a]]]
        for b in range(a + 1, n):
            total -= U[a, b] * m.x[b]
        m.x[a] = total / U[a, a]
        v[m.speed[m.order[a]]] = m.x[a]


_tree = by_bundle(Matrices, _by_composite_bodies, _by_recursion)
_half = by_bundle(Matrices, _half_by_composite_bodies, _half_by_recursion)
_rest = by_bundle(Matrices, _rest_by_composite_bodies, _rest_by_recursion)


@kernel
def tree_and_rows(route, s):
    """Accelerations of the tree without closure loads, the rows, and F^-1 J' of every row; a status code."""
    status = _tree(s.route, s.c, s.w)
    if status != OK:
        return status
    c, seen = s.c, s.seen
    for i in range(seen.q.shape[0]):
        seen.q[i] = s.w.q[i]
    for j in range(seen.u.shape[0]):
        seen.u[j] = s.w.u[j]
        seen.speed[j].acceleration = s.w.speed[j].acceleration
    velocity_sweep(c, seen, True, True)
    pose_sweep(c, seen)
    acceleration_sweep(c, seen)
    evaluate_rows(c, seen, s.cc, s.cw, True)
    _half_solve(s)
    return OK


@helper
def _half_solve(s):
    """Write J' of every row to cw.half, then replace it by F^-1 J'."""
    c, cc, cw = s.c, s.cc, s.cw
    for i in range(cc.closure.shape[0]):
        for r in range(cc.closure[i].row_start, cc.closure[i].row_stop):
            apply_unit_load(c, s.seen, cc, cw, i, r)
            pass_load(s.route, s, i, cw.half, row_place(cc, cc.closure[i].group, r))


@sweep
def pass_load(route, s, i, x, at):
    """F^-1 T for the generalised forces T of cw.response on the path of closure i; by column, from x[at] on."""
    for j in range(s.cc.closure[i].path_start, s.cc.closure[i].path_stop):
        innovations.project(s.c, s.seen, s.cw.response, s.cc.path[j])
    _half(s.route, s, i, x, at)


@sweep
def respond(route, s, y, v):
    """v = F'^-1 y: the change of all speeds; zero for prescribed ones."""
    _rest(s.route, s.c, s.w, y, v)


@helper
def accelerate(route, s):
    """Add the effect of cw.row.load to the accelerations and drive loads."""
    cw, y = s.cw, s.cw.coefficient
    for r in range(cw.row.shape[0]):
        cw.solution[r] = cw.row[r].load
    sum_rows(s.cc, cw, y)
    respond(route, s, y, cw.step)
    driven = False
    for j in range(y.shape[0]):
        s.w.speed[j].acceleration += cw.step[j]
        driven = driven or s.c.speed[j].prescribed >= 0
    if driven:
        hinge_and_drive_loads(route, s)


@helper
def hinge_and_drive_loads(route, s):
    """Compute w.body.load and w.speed.drive from the accelerations and constraint loads; overwrites the factors of M.
    """
    c, w, cc, cw = s.c, s.w, s.cc, s.cw
    tau, T = cw.step, cw.response.speed
    inverse_dynamics(c, w, tau)
    clear(c, cw.response)
    for i in range(cc.closure.shape[0]):
        apply_rows(c, s.seen, cc, cw, i)
    for k in range(c.body.shape[0] - 1, -1, -1):
        innovations.project(c, s.seen, cw.response, k)
        F = vec6(cw.response.body[k].force, 0)
        i = c.body[k].outboard_port
        if i >= 0:
            F = times6(matmul(mat3(w.port[i].R, 0), transpose(mat3(s.seen.port[i].R, 0))), F)
        add6(w.body[k].load, 0, F)
    for j in range(T.shape[0]):
        w.speed[j].drive = tau[j] - w.speed[j].applied - T[j] if c.speed[j].prescribed >= 0 else 0.0
    pose_sweep(c, w)


@sweep
def locate(route, t, y, s):
    """Evaluate the rows' values and rates at y; keeps the factors of M."""
    load_state(t, y, s.c, s.seen)
    velocity_sweep(s.c, s.seen, True, True)
    pose_sweep(s.c, s.seen)
    evaluate_rows(s.c, s.seen, s.cc, s.cw, False)
