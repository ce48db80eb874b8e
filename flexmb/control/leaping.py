"""The closed loop across a singular position of a closed chain: the motion leaps (`flexmb.closure.leap`), and with it
what controllers know.

The motion leaps under what controllers say before the leap. Beyond it is seen what they say there, and the trapezoidal
rule takes the mean of both: speeds are corrected by half a leap's length of the change of accelerations, along which
all closures stay closed, and states of controllers take the rule as it is.
"""

from math import inf

from flexmb.control import tables as a
from flexmb.control.loop import accelerate, follow, give, settle, steer, take
from flexmb.jit.direct import real_at
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.status import OK


@kernel
def back(y, s):
    """Put the last good state of the run into y; returns its time (s), -inf where there is none."""
    t = real_at(s.address[a.BACK], (s.y, s.address[a.CONSTANTS]))
    if t > -inf:
        give(s.y, s.good, s, y)
    return t


@kernel
def leap(end, y, dy, y_new, dy_new, s):
    """Leap as the motion does: see `flexmb.closure.leap.leap`; y, dy, y_new and dy_new = [q, u, x, work] (n,)."""
    t = real_at(s.address[a.BACK], (s.before, s.address[a.CONSTANTS]))
    if not t > -inf or _slope(t, y, dy, s) != OK:
        return 0.0
    h = real_at(
        s.address[a.LEAP], (end, s.before, s.slope_before, s.after, s.slope_after, s.address[a.CONSTANTS])
    )
    if not h > 0.0:
        return 0.0
    n, m = y.shape[0], s.y.shape[0] - 1
    _put(s.before, y)
    _put(s.slope_before, dy)
    _put(s.after, y_new)
    for i in range(m, n - 1):
        y_new[i] = y[i] + h * dy[i]
    if _slope(t + h, y_new, dy_new, s) == OK:  # else the next step tells why not
        for i in range(m):
            y_new[i] += 0.5 * h * (dy_new[i] - s.slope_after[i])
        y_new[n - 1] += 0.5 * h * (dy_new[n - 1] - s.slope_after[m])
        for i in range(m, n - 1):
            y_new[i] = y[i] + 0.5 * h * (dy[i] + dy_new[i])
        settle(t + h, y_new, s)
        _slope(t + h, y_new, dy_new, s)
    return h


@helper
def _slope(t, y, dy, s):
    """dy at y, under what continuous controllers say there; returns a status code."""
    take(y, s)
    status = OK
    if s.continuous[0]:
        status = steer(t, s)
    if status == OK:
        status = accelerate(t, s)
    if status == OK and s.follows[0]:
        status = follow(t, s)
    give(s.dy, s.change, s, dy)
    return status


@helper
def _put(of_motion, y):
    """[q, u, work] into y = [q, u, x, work]."""
    m = of_motion.shape[0] - 1
    for i in range(m):
        y[i] = of_motion[i]
    y[y.shape[0] - 1] = of_motion[m]
