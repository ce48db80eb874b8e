"""Projection on the constraint manifold: the nearest coordinates and speeds in the metric of kinetic energy.

Positions: dq = -M^-1 J' (J M^-1 J')^-1 g, repeated with the same matrices until g vanishes to round-off; then speeds
likewise with J u. Prescribed coordinates do not change. Only independent rows are corrected; dependent rows must be
fulfilled with them.
"""

import numpy as np

from flexmb.closure.branch import has_started, is_further, leave, notice, recall, remember
from flexmb.closure.factor import solve, sum_rows
from flexmb.closure.forces import choose, factorised, free_tree, locate, on_branch, respond
from flexmb.closure.rows import fastest_opening, largest_gap
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.motion.coordinates import configuration_rate, load_state, normalise_quaternions, put_back
from flexmb.tables.status import CLOSURE_OPEN, OK

CLOSED = 2.0**-44  # a closed row's value relative to the size of its closure: 5.7e-14 = 256 * 2^-52
OPEN = 1e-10  # beyond this a closure is open
ADRIFT = 1e-2  # beyond this a stabilised closure is open: the stabilisation is not effective
MOVING_APART = 1e-8  # beyond this, relative to the speed of its ports, a closure opens ...
SLOWEST = OPEN / MOVING_APART  # ... which counts as at least so many sizes per step: at rest speeds are only rounding
REPEATS = 6


@helper
def project_closed(t, y, s):
    """Project y on the manifold of the closures, in place; a failure is stored in cw.failure."""
    put_back(t, y, s.c)
    s.cw.failure[0] = OK
    status = _project(t, y, s)
    if status != OK:
        s.cw.failure[0] = status
        s.cw.failure[1] = s.w.fault[0]
        s.cw.time[1] = np.nextafter(t, -np.inf)  # the last stage of a segment is evaluated one ulp before its end
        recall(s.cw)
    elif is_further(t, s.cw):
        remember(t, y, s.cc, s.cw)


@helper
def _project(t, y, s):
    cc, cw = s.cc, s.cw
    load_state(t, y, s.c, s.w)
    status = free_tree(s.route, s)
    if status == OK and is_further(t, cw):
        status = _choose_further(t, s)
    if status == OK:
        status = factorised(s.w, cc, cw)
    if status != OK:
        return status
    if cw.gain[1] > 0.0:  # stabilised: errors decay by themselves
        gap, at = largest_gap(cc, cw)
        return OK if gap <= ADRIFT else _open(s, at)
    close(t, y, CLOSED, s)
    gap, at = largest_gap(cc, cw)
    if not gap <= OPEN:
        return _open(s, at)
    rate, at = fastest_opening(cc, cw, SLOWEST / abs(t - cw.time[0]))
    return OK if rate <= MOVING_APART else _open(s, at)


@helper
def _choose_further(t, s):
    """Choose the independent rows for the next step, after checking that the last one stayed on its branch."""
    status = OK
    if has_started(s.cw):
        status = factorised(s.w, s.cc, s.cw)
    if status == OK:
        status = on_branch(t, s.w, s.cc, s.cw)
    if status == OK and has_started(s.cw):
        leave(t, s.cc, s.cw)
        notice(t, s.cc, s.cw)
    if status == OK:
        status = choose(s.w, s.cc, s.cw)
    return status


@helper
def _open(s, closure):
    s.w.fault[0] = closure
    return CLOSURE_OPEN


@kernel
def close(t, y, closed, s):
    """Close positions up to gaps of `closed` sizes, then speeds, with the factors that were found last."""
    cc, cw = s.cc, s.cw
    for _ in range(REPEATS):
        if largest_gap(cc, cw)[0] <= closed:
            break
        for place in range(cw.chosen.shape[0]):
            cw.scratch[place] = -cw.row[cw.chosen[place]].value
        _response(s)
        displace(t, y, s)
        locate(s.route, t, y, s)
    nq = s.w.q.shape[0]
    for _ in range(2):
        for place in range(cw.chosen.shape[0]):
            cw.scratch[place] = -cw.row[cw.chosen[place]].rate
        _response(s)
        for j in range(s.w.u.shape[0]):
            y[nq + j] += cw.step[j]
        locate(s.route, t, y, s)


@sweep
def _response(s):
    """cw.step = M^-1 J' (J M^-1 J')^-1 cw.scratch, with the factors of the last forward dynamics."""
    solve(s.cc, s.cw)
    sum_rows(s.cc, s.cw, s.cw.coefficient)
    respond(s.route, s, s.cw.coefficient, s.cw.step)


@sweep
def displace(t, y, s):
    """Move y by the displacement cw.step."""
    c, w = s.c, s.w
    load_state(t, y, c, w)
    for j in range(w.u.shape[0]):
        w.u[j] = s.cw.step[j]
    configuration_rate(c, w, w.rate)
    for i in range(w.q.shape[0]):
        y[i] += w.rate[i]
    normalise_quaternions(y, c)
