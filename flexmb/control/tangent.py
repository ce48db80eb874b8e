"""Derivatives of the closed loop with continuous controllers, for methods that need Jacobians.

    J = df/dy with the drives s held  +  df/ds ds/dy,     dx'/dy the rates of the controllers' states

The part of the motion is exact (`flexmb.entry.tangent`), and so is df/ds up to rounding, since forces are linear in the
drives. Sensors and laws are differentiated by finite differences, since user laws accept only plain numbers. Newton
iterations converge to the same solution as with an exact Jacobian, since they end when the equations are fulfilled.
"""

from flexmb.control import tables as a
from flexmb.control.loop import accelerate, follow, steer, take
from flexmb.jit.direct import status_at
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.status import OK

STEP = 2.0**-17  # of central differences, in SI units or relative: its square and 2^-53 / STEP are below 1e-10
LARGE = 2.0**20  # change of a drive, whose effect is linear: large, so that rounding of other loads is negligible


@kernel
def jacobian(t, y, J, s, w):
    """J (n,n) = d(dy/dt)/dy of y = [q, u, x, work] (n,), row by row; returns a status code."""
    take(y, s)
    status = steer(t, s)
    if status == OK:
        status = status_at(
            w.address[a.JACOBIAN], (t, s.y, w.of_motion, w.address[a.EXACT], w.address[a.TANGENT])
        )
    if status == OK:
        status = _effects(t, s, w)
    if status != OK:
        return status
    _spread(w.of_motion, J)
    for i in range(y.shape[0]):
        w.y[i] = y[i]
    for i in range(w.column.shape[0]):
        place = w.column[i]
        h = STEP * max(1.0, abs(y[place]))
        w.y[place] = y[place] + h
        status = _see(t, w.y, s, w.ahead)
        if status != OK:
            return status
        w.y[place] = y[place] - h
        status = _see(t, w.y, s, w.behind)
        if status != OK:
            return status
        w.y[place] = y[place]
        _add_column(place, 0.5 / h, J, s, w)
    return OK


@helper
def _effects(t, s, w):
    """Compute the rows of w.effect: d[q, u, work]'/ds of each drive s; returns a status code."""
    status = accelerate(t, s)
    for i in range(s.dy.shape[0]):
        w.slope[i] = s.dy[i]
    for d in range(s.drive.shape[0]):
        f = s.drive[d].function
        value = s.function[f].data[0]
        s.function[f].data[0] = value + LARGE
        if status == OK:
            status = accelerate(t, s)
        s.function[f].data[0] = value
        for i in range(s.dy.shape[0]):
            w.effect[d, i] = (s.dy[i] - w.slope[i]) / LARGE
    return status


@helper
def _spread(of_motion, J):
    """Copy the motion's Jacobian to J with zero rows and columns for x; nothing depends on work."""
    m, n = of_motion.shape[0] - 1, J.shape[0]
    for i in range(n):
        for j in range(n):
            J[i, j] = 0.0
    for j in range(m):
        for i in range(m):
            J[i, j] = of_motion[i, j]
        J[n - 1, j] = of_motion[m, j]


@helper
def _see(t, y, s, seen):
    """Write the drive values at y, then the rates of x, to `seen`; returns a status code."""
    take(y, s)
    status = steer(t, s)
    if status == OK and s.follows[0]:
        status = accelerate(t, s)
        if status == OK:
            status = follow(t, s)
    drives = s.drive.shape[0]
    for d in range(drives):
        seen[d] = s.drive[d].gain * s.signal[s.drive[d].signal]
    for i in range(s.controller.shape[0]):
        o = s.controller[i]
        if not o.sampled:
            for j in range(o.states):
                seen[drives + o.x + j] = s.change[o.state + j]
    return status


@helper
def _add_column(place, factor, J, s, w):
    """Add the effects of y[place] through the controllers to J."""
    drives, m, n = s.drive.shape[0], s.y.shape[0] - 1, J.shape[0]
    for d in range(drives):
        change = factor * (w.ahead[d] - w.behind[d])
        if change != 0.0:
            for i in range(m):
                J[i, place] += w.effect[d, i] * change
            J[n - 1, place] += w.effect[d, m] * change
    for i in range(m, n - 1):
        J[i, place] = factor * (w.ahead[drives + i - m] - w.behind[drives + i - m])
