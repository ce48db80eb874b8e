"""Entry points of closed chains: right-hand side, what is observable at one state, linearised closures, projection."""

from flexmb.balance import power
from flexmb.closure.factor import choose_rows
from flexmb.closure.forces import add_loads, choose, free_tree, row_loads
from flexmb.closure.projection import displace, locate, project_closed
from flexmb.closure.rows import load_on_b
from flexmb.closure.unit_loads import pass_outward
from flexmb.coordinates import configuration_rate, load_state
from flexmb.dynamics import world_loads
from flexmb.kernel import helper, kernel
from flexmb.loads import drive_loads, hinge_loads
from flexmb.spatial.vector import mat3, store3, times
from flexmb.status import OK

NOTHING, COORDINATES, SPEEDS = range(3)


@helper
def rhs(t, y, dy, model, _):
    """dy/dt of y = [q, u, work] at time t; returns a status code, that of the projection before it too."""
    c, w, cc, cw = model
    if cw.failure[0] != OK:
        w.fault[0] = cw.failure[1]
        return cw.failure[0]
    load_state(t, y, c, w)
    status = free_tree(c, w, cc, cw)
    if status == OK:
        status = row_loads(c, w, cc, cw)
    if status != OK:
        return status
    add_loads(c, w, cc, cw)
    drive_loads(c, w)
    configuration_rate(c, w)
    nq, nu = w.q.shape[0], w.u.shape[0]
    for i in range(nq):
        dy[i] = w.rate[i]
    for j in range(nu):
        dy[nq + j] = w.speed[j].acceleration
    dy[nq + nu] = power(c, w)
    return OK


@helper
def project(t, y, model):
    """Put y on the manifold of closures, unit quaternions and prescribed coordinates."""
    c, w, cc, cw = model
    project_closed(t, y, c, w, cc, cw)


@kernel
def linearise(t, y, c, w, cc, cw):
    """The tree without closure loads at y: rows with accelerations, their half-solved unit loads; returns a status."""
    load_state(t, y, c, w)
    return free_tree(c, w, cc, cw)


@kernel
def count_rows(cc, cw):
    """Independent rows at the state that was linearised last, into cw.rank and cw.chosen."""
    cw.rank[0] = -1
    choose_rows(cc, cw)


@kernel
def move(t, y, x, what, c, w, cc, cw):
    """Change y by (1 - H Psi K)' D^-1/2 x of the state linearised last, and find its rows' values and rates.

    what: COORDINATES displaces it, SPEEDS adds to the speeds, NOTHING leaves it.
    """
    if what != NOTHING:
        pass_outward(c, w, cw, x, cw.step)
    if what == COORDINATES:
        displace(t, y, c, w, cw)
    elif what == SPEEDS:
        nq = w.q.shape[0]
        for j in range(w.u.shape[0]):
            y[nq + j] += cw.step[j]
    locate(t, y, c, w, cc, cw)


@kernel
def closure_loads(c, w, cc, cw):
    """Loads of cw.rank independent rows at the state that was linearised last, into cw.row.load; a status code."""
    status = choose(c, w, cc, cw)
    if status == OK:
        status = row_loads(c, w, cc, cw)
    return status


@kernel
def loads(c, w, cc, cw, hinges, closures):
    """Accelerations and loads under the rows' loads in cw.row.load, at the state that was linearised last.

    hinges (N,6), closures (C,6): [torque; force] on the outboard body about O, on body_b about frame B; World axes.
    """
    add_loads(c, w, cc, cw)
    drive_loads(c, w)
    hinge_loads(c, w)
    world_loads(c, w, hinges)
    for i in range(cc.closure.shape[0]):
        R = mat3(cw.closure[i].world, 0)
        tau, f = load_on_b(cc, cw, i)
        store3(closures[i], 0, times(R, tau))
        store3(closures[i], 3, times(R, f))
