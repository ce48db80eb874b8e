"""Leaps of the closed loop over a singular position of a closed chain: motion (`flexmb.closure.leap`) and controllers.

The motion first leaps under the drive values at the start of the leap. Then two computations alternate until the
speeds have converged: the states of controllers are integrated in small substeps along the cubic between both ends,
and the motion is integrated again by Lobatto's rule under the resulting drives. The drive values at the inner nodes are
not those at these instants; they are chosen to reproduce the average and first moment over the leap. These have the
same effect on speeds and coordinates, also where a controller saturates within the leap or oscillates faster than the
rule resolves.

If controllers are too fast for this, alone or in feedback with the motion, or read accelerations, the leap is discarded
and the run ends before the singular position with the status of a singular position.
"""

from math import inf, nan, sqrt

import numpy as np

from flexmb.control import tables as a
from flexmb.control.loop import accelerate, give, keep_good, steer, take
from flexmb.integrate.control import Interval, copy
from flexmb.integrate.leap import EDGE_WEIGHT, INNER, INNER_WEIGHT, cubic
from flexmb.jit.direct import real_at, status_at
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.tables.status import OK

# Relative accuracy of speeds and controller states: below the tightest usual tolerance, 1e-10.
WANTED = 2.0**-34
# The longest leap takes 2^-9 of the time in which a mechanism moves by its own size. Drives that change as fast as the
# mechanism moves have an initial error of this order, and speeds one of 2^-18; `ITERATIONS` iterations with the
# contraction factor `CONTRACTION` reduce it to `WANTED`.
ITERATIONS = 4
CONTRACTION = 2.0**-4
# Relative rounding error of speeds normal to the branch, which controllers measure: at a distance of 2^-13 a gap of
# 2^-50 is a position error of 2^-37, and divided by 2^-13 a speed error of 2^-24; a few times more for long chains.
NORMAL_ROUNDING = 2.0**-20
# Initial number of substeps of a leap for controller states. A limit that is reached within a substep changes the
# average of a drive by 2^-15 of its change, and speeds by 2^-33 at most.
PARTS = 32
# Largest number of substeps, so that the refinement ends; it decides only which fast controllers end a run.
FINEST = 2048
# A substep of z time constants of a controller corrects its rates by a factor of z/2 in each stage, and has an error of
# z^4/120 relative to the decaying part.
SLOW = 0.5 * (120.0 * WANTED) ** 0.25


@kernel
def back(y, s):
    """Copy the last accepted state of the run to y; returns its time (s), -inf if there is none."""
    t = real_at(s.address[a.BACK], (s.y, s.address[a.CONSTANTS]))
    if t > -inf:
        give(s.y, s.good, s, y)
    return t


@kernel
def leap(end, y, dy, y_new, dy_new, s):
    """Leap with controllers; as `flexmb.closure.leap.leap`, but y, dy, y_new and dy_new = [q, u, x, work] (n,)."""
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
    if not s.continuous[0] or (not s.follows[0] and _follow(Interval(t, t + h, t + h), y, dy, y_new, dy_new, s)):
        keep_good(s)
        return h
    s.stuck[0] = 1
    return 0.0


@helper
def _slope(t, y, dy, s):
    """dy at y under the outputs of the continuous controllers there; returns a status code."""
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
    """Copy [q, u, work] into y = [q, u, x, work]."""
    m = of_motion.shape[0] - 1
    for i in range(m):
        y[i] = of_motion[i]
    y[y.shape[0] - 1] = of_motion[m]


@helper
def _follow(step, y, dy, y_new, dy_new, s):
    """Iterate y_new and dy_new with controllers, from those under the drives before the leap; whether they converge."""
    effect, former = inf, np.empty(s.drive.shape[0])
    for i in range(s.y.shape[0] - 1, y.shape[0] - 1):
        y_new[i], dy_new[i] = y[i], dy[i]
    for d in range(former.shape[0]):
        s.driven[3, d] = s.function[s.drive[d].function].data[0]
    for iteration in range(ITERATIONS + 1):
        copy(s.driven[3], former)
        if not _carry(step, y, dy, y_new, dy_new, s) or _arrive(step.end, y_new, dy_new, s) != OK:
            return False
        effect, last = _effect(step, former, dy_new, s), effect
        if not effect <= CONTRACTION * (last + NORMAL_ROUNDING):
            return False
        if effect <= WANTED:
            break
        if iteration < ITERATIONS and _move(step, y, dy, y_new, dy_new, s) != OK:
            return False
    return True


@helper
def _carry(step, y, dy, y_new, dy_new, s):
    """Integrate x along the leap into y_new, and the drives into s.driven; whether the substeps are short enough."""
    parts = PARTS
    while parts <= FINEST:
        if _carry_in(parts, step, y, dy, y_new, dy_new, s):
            _place_drives(s)
            return True
        parts *= 2
    return False


@sweep
def _carry_in(parts, step, y, dy, y_new, dy_new, s):
    """As `_carry`, by the classical Runge-Kutta rule in `parts` substeps; rows 1 and 2 of s.driven get the average and
    the first moment."""
    n, m = y.shape[0], s.y.shape[0] - 1
    trial, k, x, part = np.empty(n), np.zeros((4, n)), np.empty(n), (step.end - step.start) / parts
    for i in range(m, n - 1):
        x[i] = y[i]
    for d in range(s.drive.shape[0]):
        s.driven[1, d] = s.driven[2, d] = 0.0
    for p in range(parts):
        for stage in range(4):
            ahead = 0.5 * ((stage + 1) // 2)
            place = (p + ahead) / parts
            t = step.start + place * (step.end - step.start)
            cubic(step, y, dy, y_new, dy_new, t, trial)
            for i in range(m, n - 1):
                trial[i] = x[i] + ahead * part * k[stage - 1, i] if stage > 0 else x[i]
            take(trial, s)
            if steer(t, s) != OK:
                return False
            give(s.dy, s.change, s, k[stage])
            weight = (1.0 if stage in (0, 3) else 2.0) / (6.0 * parts)
            for d in range(s.drive.shape[0]):
                value = s.function[s.drive[d].function].data[0]
                s.driven[1, d] += weight * value
                s.driven[2, d] += weight * place * value
                if p == 0 and stage == 0:
                    s.driven[0, d] = value
                s.driven[3, d] = value
        if not _is_slow(k, x, part, parts * part, m, s):
            return False
        for i in range(m, n - 1):
            x[i] += part / 6.0 * (k[0, i] + 2.0 * (k[1, i] + k[2, i]) + k[3, i])
    for i in range(m, n - 1):
        y_new[i] = x[i]
    return True


@helper
def _is_slow(k, x, part, h, m, s):
    """Whether the second and third stage rates of a substep are close: they differ only by the controller's states."""
    for i in range(s.controller.shape[0]):
        o = s.controller[i]
        if not o.sampled:
            left, change, size = 0.0, 0.0, 0.0
            for j in range(m + o.x, m + o.x + o.states):
                left += (part * (k[2, j] - k[1, j])) ** 2
                change += (part * (k[1, j] - k[0, j])) ** 2
                size += x[j] ** 2 + (h * k[0, j]) ** 2
            if not left <= SLOW**2 * change + WANTED**2 * size:
                return False
    return True


@helper
def _place_drives(s):
    """Replace average and first moment in rows 1 and 2 of s.driven by equivalent values at Lobatto's inner nodes."""
    for d in range(s.drive.shape[0]):
        inner = (s.driven[1, d] - EDGE_WEIGHT * (s.driven[0, d] + s.driven[3, d])) / INNER_WEIGHT
        moment = (s.driven[2, d] - EDGE_WEIGHT * s.driven[3, d]) / INNER_WEIGHT
        rise = (moment - 0.5 * inner) / (1.0 - 2.0 * INNER)
        s.driven[1, d], s.driven[2, d] = 0.5 * inner - rise, 0.5 * inner + rise


@helper
def _arrive(t, y, dy, s):
    """dy at the end of the leap, y, after projection; returns a status code."""
    take(y, s)
    status = steer(t, s)
    if status == OK:
        status = _slope_beside(t, s)
    give(s.y, s.state, s, y)
    give(s.dy, s.change, s, dy)
    return status


@helper
def _effect(step, former, dy, s):
    """Relative effect of the change of drives on the speeds at the end of the leap, where dy is the slope."""
    for d in range(former.shape[0]):
        s.function[s.drive[d].function].data[0] = former[d]
    if _slope_beside(step.end, s) != OK:
        return nan
    change, size, m = 0.0, 0.0, s.y.shape[0] - 1
    for i in range(m - s.rates.shape[0], m):
        change += (dy[i] - s.dy[i]) ** 2
        size += s.y[i] ** 2
    return (step.end - step.start) * sqrt(change / size)


@helper
def _slope_beside(t, s):
    """s.dy on either side of the singular position, after s.y is projected to round-off."""
    return status_at(s.address[a.BESIDE], (t, s.y, s.dy, s.address[a.CONSTANTS]))


@helper
def _move(step, y, dy, y_new, dy_new, s):
    """q, u and work of y_new by Lobatto's rule under the drives at its nodes; returns a status code."""
    h, n, m = step.end - step.start, y.shape[0], s.y.shape[0] - 1
    inner, total = np.empty(n), np.empty(n)
    for i in range(n):
        total[i] = EDGE_WEIGHT * (dy[i] + dy_new[i])
    for node in (1, 2):
        t = step.start + (INNER if node == 1 else 1.0 - INNER) * h
        cubic(step, y, dy, y_new, dy_new, t, inner)
        take(inner, s)
        for d in range(s.drive.shape[0]):
            s.function[s.drive[d].function].data[0] = s.driven[node, d]
        status = _slope_beside(t, s)
        if status != OK:
            return status
        for i in range(m + 1):
            total[i if i < m else n - 1] += INNER_WEIGHT * s.dy[i]
    for i in range(m + 1):
        j = i if i < m else n - 1
        y_new[j] = y[j] + h * total[j]
    return OK
