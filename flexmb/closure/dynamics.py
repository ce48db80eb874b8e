"""Entry points of closed chains: right-hand side, observation at one state, linearised closures, projection."""

from flexmb.closure.factor import choose_rows
from flexmb.closure.forces import accelerate, choose, free_tree, locate, on_branch, refine, respond, row_loads, transmit
from flexmb.closure.projection import displace, project_closed
from flexmb.closure.rows import load_on_b
from flexmb.closure.sizes import measure_ports
from flexmb.entry.articulated import world_loads
from flexmb.jain.balance import power
from flexmb.jit.kernel import kernel, written_out
from flexmb.motion.coordinates import load_state, store_slope
from flexmb.spatial.vector import mat3, store3, times
from flexmb.tables.status import OK

UNCHANGED, COORDINATES, SPEEDS = range(3)


@kernel
def rhs(t, y, dy, s, _):
    """dy/dt of y = [q, u, work] at time t; returns a status code, also that of a preceding projection.

    The closed chain holds constants and workspace: it is passed for both arguments.
    """
    return slope(t, y, dy, s)


@written_out
def slope(t, y, dy, s):
    """The right-hand side, for calls from other kernels."""
    c, w, cw = s.c, s.w, s.cw
    if cw.failure[0] != OK and t >= cw.time[1]:  # at an earlier time a shorter step is tried
        w.fault[0] = cw.failure[1]
        return cw.failure[0]
    load_state(t, y, c, w)
    status = free_tree(s.route, s)
    if status == OK:
        status = row_loads(w, s.cc, cw)
    if status == OK:
        status = on_branch(t, w, s.cc, cw)
    if status != OK:
        return status
    accelerate(s.route, s)
    refine(s.route, s)
    store_slope(c, w, power(c, w), dy)
    return OK


@kernel
def project(t, y, s):
    """Project y on the manifold of closures, unit quaternions and prescribed coordinates."""
    project_closed(t, y, s)


@kernel
def linearise(t, y, s):
    """Evaluate, at y and without constraint loads, the rows with their accelerations, the half-solved unit loads and
    the sizes; returns a status code."""
    load_state(t, y, s.c, s.w)
    status = free_tree(s.route, s)
    if status == OK:
        measure_ports(s)
    return status


@kernel
def count_rows(cc, cw):
    """Independent rows at the state that was linearised last, into cw.rank and cw.chosen."""
    for g in range(cw.rank.shape[0]):
        cw.rank[g] = -1
    choose_rows(cc, cw)


@kernel
def move(t, y, x, what, s):
    """Change y by M^-1 J'f and evaluate the rows' values and rates there; x (nu,) are the innovations of J'f at the
    state linearised last.

    what: COORDINATES displaces y, SPEEDS adds to the speeds, UNCHANGED leaves y unchanged.
    """
    if what != UNCHANGED:
        respond(s.route, s, x, s.cw.step)
    if what == COORDINATES:
        displace(t, y, s)
    elif what == SPEEDS:
        nq = s.w.q.shape[0]
        for j in range(s.w.u.shape[0]):
            y[nq + j] += s.cw.step[j]
    locate(s.route, t, y, s)


@kernel
def closure_loads(w, cc, cw):
    """Loads of cw.rank independent rows at the state that was linearised last, into cw.row.load; a status code."""
    status = choose(w, cc, cw)
    if status == OK:
        status = row_loads(w, cc, cw)
    return status


@kernel
def loads(s, hinges, closures):
    """Accelerations and loads under the rows' loads in cw.row.load, at the state that was linearised last.

    hinges (N,6), closures (C,6): [torque; force] on the outboard body about O, on body_b about frame B; World axes.
    """
    accelerate(s.route, s)
    refine(s.route, s)  # as in runs, or rows of light bodies would keep accelerations of rounding
    transmit(s.route, s)
    world_loads(s.c, s.w, hinges)
    for i in range(s.cc.closure.shape[0]):
        R = mat3(s.cw.closure[i].world, 0)
        tau, f = load_on_b(s.cc, s.cw, i)
        store3(closures[i], 0, times(R, tau))
        store3(closures[i], 3, times(R, f))
