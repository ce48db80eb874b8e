"""Back to where the closures are closed: the nearest coordinates and speeds in the metric of kinetic energy.

Positions: dq = -M^-1 J' (J M^-1 J')^-1 g, repeated with the same matrices until g vanishes to round-off; then speeds
likewise with J u. Prescribed coordinates stay. It only uses the independent rows; the others must follow.
"""

from flexmb.closure.factor import factorise, solve
from flexmb.closure.forces import choose, free_tree
from flexmb.closure.rows import evaluate_rows, largest_gap
from flexmb.closure.unit_loads import pass_outward
from flexmb.coordinates import configuration_rate, load_state, normalise_quaternions
from flexmb.coordinates import project as project_tree
from flexmb.jain.kinematics import pose_sweep, velocity_sweep
from flexmb.kernel import helper
from flexmb.status import CLOSURE_OPEN, CLOSURE_SINGULAR, OK

CLOSED = 2.0**-44  # a closed row's value in the size of its closure: 5.7e-14, two hundred roundings
OPEN = 1e-10  # beyond this a closure is open
MOVING_APART = 1e-8  # beyond this, in the speed of its ports, a closure opens
REPEATS = 6


@helper
def project_closed(t, y, c, w, cc, cw):
    """Put y on the manifold of the closures, in place; what prevents it is left in cw.failure."""
    project_tree(t, y, c)
    cw.failure[0] = OK
    status = _project(t, y, c, w, cc, cw)
    if status != OK:
        cw.failure[0] = status
        cw.failure[1] = w.fault[0]


@helper
def _project(t, y, c, w, cc, cw):
    load_state(t, y, c, w)
    status = free_tree(c, w, cc, cw)
    if status != OK:
        return status
    status = choose(c, w, cc, cw)
    if status != OK:
        return status
    dependent = factorise(cc, cw)
    if dependent >= 0:
        w.fault[0] = cc.row[dependent].closure
        return CLOSURE_SINGULAR
    if cw.gain[1] > 0.0:  # stabilised: errors decay by themselves
        return OK
    _close(t, y, c, w, cc, cw)
    gap, at = largest_gap(cc, cw, False)
    if not gap <= OPEN:
        w.fault[0] = at
        return CLOSURE_OPEN
    gap, at = largest_gap(cc, cw, True)
    if not gap <= MOVING_APART:
        w.fault[0] = at
        return CLOSURE_OPEN
    return OK


@helper
def _close(t, y, c, w, cc, cw):
    """Positions, then speeds."""
    for _ in range(REPEATS):
        if largest_gap(cc, cw, False)[0] <= CLOSED:
            break
        for a in range(cw.rank[0]):
            cw.scratch[a] = -cw.row[cw.chosen[a]].value
        _response(c, w, cc, cw)
        displace(t, y, c, w, cw)
        locate(t, y, c, w, cc, cw)
    nq = w.q.shape[0]
    for _ in range(2):
        for a in range(cw.rank[0]):
            cw.scratch[a] = -cw.row[cw.chosen[a]].rate
        _response(c, w, cc, cw)
        for j in range(w.u.shape[0]):
            y[nq + j] += cw.step[j]
        locate(t, y, c, w, cc, cw)


@helper
def _response(c, w, cc, cw):
    """cw.step = M^-1 J' (J M^-1 J')^-1 cw.scratch, with the factors of the last forward dynamics."""
    solve(cw)
    x = cw.coefficient
    for j in range(x.shape[0]):
        x[j] = 0.0
        for r in range(cc.row.shape[0]):
            x[j] += cw.row[r].load * cw.half[r, j]
    pass_outward(c, w, cw, x, cw.step)


@helper
def displace(t, y, c, w, cw):
    """y moves by the displacement cw.step for a unit of time."""
    load_state(t, y, c, w)
    for j in range(w.u.shape[0]):
        w.u[j] = cw.step[j]
    configuration_rate(c, w)
    for i in range(w.q.shape[0]):
        y[i] += w.rate[i]
    normalise_quaternions(y, c)


@helper
def locate(t, y, c, w, cc, cw):
    """Rows' values and rates at y; the factors of the last forward dynamics stay."""
    load_state(t, y, c, w)
    velocity_sweep(c, w, False, False)
    pose_sweep(c, w)
    evaluate_rows(c, w, cc, cw, False)
