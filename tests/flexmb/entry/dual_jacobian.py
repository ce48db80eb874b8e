"""The Jacobian of a tree's equations of motion by dual numbers, against which tests hold the recursion: seven columns
in one evaluation.

    w = tangent_workspace(system.constants, system.nq, system.nu)
    status = jacobian(t, y, J, system.constants, w)
"""

from flexmb.entry.articulated import slope
from flexmb.jit.duals import RATES, rate, seeded
from flexmb.jit.kernel import kernel
from flexmb.tables.status import OK


@kernel
def jacobian(t, y, J, c, w):
    """J (n,n) = d(dy/dt)/dy at y = [q, u, work] (n,), row by row as `rhs` orders them; returns a status code.

    Prescribed coordinates and speeds are functions of time: their columns vanish, and so do their rows.
    """
    n, columns = y.shape[0], w.column.shape[0]
    w.time[0] = t
    for i in range(n):
        w.state[i] = y[i]
        for j in range(n):
            J[i, j] = 0.0
    for first in range(0, max(columns, 1), RATES):  # without any column once, for the status
        count = min(RATES, columns - first)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = seeded(w.state[j], lane)
        status = slope(w.time[0], w.state, w.slope, c, w)
        for lane in range(count):
            j = w.column[first + lane]
            w.state[j] = y[j]
            for i in range(n):
                J[i, j] = rate(w.slope[i], lane)
        if status != OK:
            return status
    return OK
