"""Derivatives of what sensors read of a closed chain, at given closure loads and by these, exact to round-off.

As `flexmb.closure.tangent` has those of the accelerations. How the loads change with the motion is for
`flexmb.linear.observed` to find, so that the rows' accelerations stay zero.
"""

from flexmb.closure.rows import load_on_b
from flexmb.closure.tangent import evaluate
from flexmb.entry.observed_tangent import read_outputs, sense
from flexmb.jit.duals import rate, seeded
from flexmb.jit.kernel import helper, kernel
from flexmb.jit.lanes import LANES
from flexmb.spatial.spatial_vector import times6
from flexmb.spatial.vector import mat3
from flexmb.tables.status import OK


@kernel
def closed_observed_jacobian(t, y, load, J, closures, c, w, cc, cw, out):
    """J (E+nu+6C+G,n+G): derivatives of `every` (E,), `drives`, the loads of closures (C,6) on body_b about B, World
    axes, and the rows' accelerations, by y = [q, u, work] (n,) and the rows' loads (G,); returns a status code.

    Tables as of `flexmb.closure.tangent.closed_jacobian`. Values are left in `out`, those of the closures' loads in
    `closures` (C,6).
    """
    n, rows, columns = y.shape[0], cc.row.shape[0], w.column.shape[0]
    w.time[0] = t
    for i in range(n):
        w.state[i] = y[i]
    for r in range(rows):
        cw.row[r].load = load[r]
    for i in range(J.shape[0]):
        for j in range(J.shape[1]):
            J[i, j] = 0.0
    for first in range(0, columns + rows, LANES):
        count = min(LANES, columns + rows - first)
        for lane in range(count):
            at = first + lane
            if at < columns:
                w.state[w.column[at]] = seeded(w.state[w.column[at]], lane)
            else:
                cw.row[at - columns].load = seeded(cw.row[at - columns].load, lane)
        status = evaluate(c, w, cc, cw)
        if status == OK:
            sense(c, w, out)
        for lane in range(count):
            at = first + lane
            if at < columns:
                w.state[w.column[at]] = y[w.column[at]]
                _read_column(J, w.column[at], lane, cc, cw, out)
            else:
                _read_column(J, n + at - columns, lane, cc, cw, out)
                cw.row[at - columns].load = load[at - columns]
        if status != OK:
            return status
    _store_loads(closures, cc, cw)
    return OK


@helper
def _read_column(J, j, lane, cc, cw, out):
    read_outputs(J, j, lane, out)
    first = out.every.shape[0] + out.drives.shape[0]
    for i in range(cc.closure.shape[0]):
        tau, f = times6(mat3(cw.closure[i].world, 0), load_on_b(cc, cw, i))
        for k in range(3):
            J[first + 6 * i + k, j] = rate(tau[k], lane)
            J[first + 6 * i + 3 + k, j] = rate(f[k], lane)
    first += 6 * cc.closure.shape[0]
    for r in range(cc.row.shape[0]):
        J[first + r, j] = rate(cw.row[r].acceleration, lane)


@helper
def _store_loads(closures, cc, cw):
    for i in range(cc.closure.shape[0]):
        tau, f = times6(mat3(cw.closure[i].world, 0), load_on_b(cc, cw, i))
        for k in range(3):
            closures[i, k] = tau[k].real
            closures[i, 3 + k] = f[k].real
