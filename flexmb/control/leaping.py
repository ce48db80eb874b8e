"""The closed loop across a singular position of a closed chain: the motion leaps (`flexmb.closure.leap`), and with it
what controllers know.

The motion leaps under what is driven before the leap. Then states of controllers are integrated in small steps along
the cubic between both ends, and speeds are corrected by what the drives were on average: along that change of
accelerations all closures stay closed. Where controllers are too fast for this, by themselves or through the motion,
or read accelerations, nothing of the leap is used, and the run ends before the singular position with the status of
one.
"""

from math import inf

import numpy as np

from flexmb.control import tables as a
from flexmb.control.loop import accelerate, give, settle, steer, take
from flexmb.jit.direct import real_at
from flexmb.jit.kernel import helper, kernel
from flexmb.tables.status import OK

PARTS = 32  # steps of controllers' states in a leap
SLOW = 0.125  # ratio of successive corrections by states' own effect, in one of these steps
CONVERGING = 0.125  # the same of accelerations by feedback, in the leap
ROUNDING = 2.0**-30  # of accelerations: less beside a singular position than elsewhere


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
    if s.stuck[0] or not t > -inf or _slope(t, y, dy, s) != OK:
        return 0.0
    h = real_at(s.address[a.LEAP], (end, s.before, s.slope_before, s.after, s.slope_after, s.address[a.CONSTANTS]))
    if not h > 0.0:
        return 0.0
    _put(s.before, y)
    _put(s.slope_before, dy)
    _put(s.after, y_new)
    _put(s.slope_after, dy_new)
    if not s.follows[0] and _carry(t, h, y, dy, y_new, dy_new, s) and _correct(t, h, y_new, dy_new, s):
        return h
    s.stuck[0] = 1
    return 0.0


@helper
def _slope(t, y, dy, s):
    """dy at y, under what continuous controllers say there; returns a status code."""
    take(y, s)
    status = OK
    if s.continuous[0]:
        status = steer(t, s)
    if status == OK:
        status = accelerate(t, s)
    give(s.dy, s.change, s, dy)
    return status


@helper
def _put(of_motion, y):
    """[q, u, work] into y = [q, u, x, work]."""
    m = of_motion.shape[0] - 1
    for i in range(m):
        y[i] = of_motion[i]
    y[y.shape[0] - 1] = of_motion[m]


@helper
def _carry(t, h, y, dy, y_new, dy_new, s):
    """x along the leap into y_new, by the classical rule, and averages of drives into s.mean; whether x is slow enough.
    """
    n, m = y.shape[0], s.y.shape[0] - 1
    trial, k, part = np.empty(n), np.zeros((4, n)), h / PARTS
    for i in range(m, n - 1):
        y_new[i] = y[i]
    for d in range(s.drive.shape[0]):
        s.mean[d] = 0.0 if s.continuous[0] else s.function[s.drive[d].function].data[0]
    if not s.continuous[0]:
        return True
    for step in range(PARTS):
        for stage in range(4):
            ahead = 0.5 * ((stage + 1) // 2)
            _between((step + ahead) / PARTS, h, y, dy, y_new, dy_new, trial)
            for i in range(m, n - 1):
                trial[i] = y_new[i] + ahead * part * k[stage - 1, i] if stage > 0 else y_new[i]
            take(trial, s)
            if steer(t + (step + ahead) * part, s) != OK:
                return False
            give(s.dy, s.change, s, k[stage])
            weight = (1.0 if stage in (0, 3) else 2.0) / (6.0 * PARTS)
            for d in range(s.drive.shape[0]):
                s.mean[d] += weight * s.function[s.drive[d].function].data[0]
        if not _is_slow(k, m, s):
            return False
        for i in range(m, n - 1):
            y_new[i] += part / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
    return True


@helper
def _between(x, h, y, dy, y_new, dy_new, result):
    """Hermite's cubic at the fraction x of the leap."""
    for i in range(y.shape[0]):
        change = y_new[i] - y[i]
        bend = (1.0 - x) * (h * dy[i] - change) - x * (h * dy_new[i] - change)
        result[i] = y[i] + x * (change + (1.0 - x) * bend)


@helper
def _is_slow(k, m, s):
    """Whether the second and third rates in a step are close: of each controller, they differ by its states alone."""
    for i in range(s.controller.shape[0]):
        o = s.controller[i]
        if not o.sampled:
            left, change, size = 0.0, 0.0, 0.0
            for j in range(m + o.x, m + o.x + o.states):
                left += (k[2, j] - k[1, j]) ** 2
                change += (k[1, j] - k[0, j]) ** 2
                size += k[0, j] ** 2
            if not left <= SLOW**2 * change + ROUNDING**2 * size:
                return False
    return True


@helper
def _correct(t, h, y_new, dy_new, s):
    """y_new by the drives' average, and its slope; whether feedback is slow enough beside the leap.

    Needs the slope by the drives of the start in s.slope_after; leaves that by those of the end in s.slope_before.
    """
    n, m = y_new.shape[0], s.y.shape[0] - 1
    if _slope(t + h, y_new, dy_new, s) != OK:
        return False
    for i in range(m):
        s.slope_before[i] = s.dy[i]
    for d in range(s.drive.shape[0]):
        s.function[s.drive[d].function].data[0] = s.mean[d]
    if accelerate(t + h, s) != OK:
        return False
    for i in range(m + 1):
        y_new[i if i < m else n - 1] += h * (s.dy[i] - s.slope_after[i])
    settle(t + h, y_new, s)
    if _slope(t + h, y_new, dy_new, s) != OK:
        return False
    left, change, size = 0.0, 0.0, 0.0
    for i in range(m - s.rates.shape[0], m):
        left += (s.dy[i] - s.slope_before[i]) ** 2
        change += (s.slope_before[i] - s.slope_after[i]) ** 2
        size += s.dy[i] ** 2
    return left <= CONVERGING**2 * change + ROUNDING**2 * size
