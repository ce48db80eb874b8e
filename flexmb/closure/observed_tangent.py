"""Derivatives of the observed quantities of a closed chain by state and constraint loads, exact to round-off.

`flexmb.closure.tangent` has those of the accelerations. `flexmb.linear.observed` then finds the change of the loads
with the state that keeps the row accelerations zero.
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
def closed_observed_jacobian(t, y, J, c, w, cc, cw, out):
    """J (E+nu+6C+G,n+G): derivatives of `every` (E,), `drives`, the loads of closures (C,6) on body_b about B, World
    axes, and the rows' accelerations, by y = [q, u, work] (n,) and the rows' loads in cw.row.load (G,); returns a
    status code. Tables as of `flexmb.closure.tangent.evaluate`. Values are left in `out`.
    """
    n, rows, columns = y.shape[0], cc.row.shape[0], w.column.shape[0]
    w.time[0] = t
    for i in range(n):
        w.state[i] = y[i]
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
                cw.row[at - columns].load = cw.row[at - columns].load.real
        if status != OK:
            return status
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

