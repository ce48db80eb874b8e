"""A leap over a singular position, from one side to the other, on the branch that the momentum selects.

At a singular position pivots of B P = Q R vanish and branches of the motion cross. A moving mechanism continues on the
branch of its present direction: loads are bounded, so its speeds cannot jump to those of another branch. Accelerations
are smooth on both sides; integrator stages cannot be evaluated only at the position itself, and near it off the branch.
So a run approaches by ordinary steps and then leaps:

1. `_length`: a short probe along the velocity shows how fast pivots fall, hence how far the position is. A leap starts
   from a distance between `NEAREST` and `LEAP` sizes of the mechanism, and covers twice the distance.
2. `_lands`: one step by Lobatto's rule of order 6, with nodes at both ends and at `INNER` from either, none of which is
   near the position. The states at the nodes are found by the trapezoidal rule. Its error is the cube of the leap over
   twelve, 2^-30 of a size from the largest distance; 2^-39 of it remains after one pass, 2^-44 from half that distance.
3. `_same_branch`: the states before and after the position are on one branch if

   - every pivot that was predicted to vanish has, on the other side, the size that its rate of fall predicts, and its
     row of Q is reversed, while all other rows have kept their direction; and
   - the accelerations that the closures demand along these rows are smooth: they change between the inner nodes as
     between these and the ends. A mechanism that only passes near a singular position turns round within the leap, and
     has opposite accelerations before and after. On branches that are hyperbolas x y = c the accelerations jump by
     4 c/d^3 at a distance of d.

Otherwise there is no leap, and steps may come closer while the position is within `LEAP` (cw.closer): they pass if the
position is not singular after all, or the run ends with the status it had.
"""

from math import inf

import numpy as np

from flexmb.closure.branch import TO_LEAP, TURNED, along, covered, passing_time, recall, remember
from flexmb.closure.factor import choose_rows, entry, factorise
from flexmb.closure.forces import accelerate, free_tree, row_loads
from flexmb.closure.projection import OPEN, close
from flexmb.closure.rows import largest_gap
from flexmb.integrate.control import Interval
from flexmb.integrate.leap import EDGE_WEIGHT, INNER, INNER_WEIGHT, cubic
from flexmb.jain.balance import power
from flexmb.jit.kernel import helper, kernel, sweep
from flexmb.motion.coordinates import load_state, put_back, store_slope
from flexmb.tables.status import CLOSURE_SINGULAR, OK

# Largest distance from a singular position, in sizes of the mechanism, at which a leap starts: see the error above.
LEAP = 2.0**-10
# A leap from nearer may end where steps are refused, and gaps of 2^-50 affect the accelerations.
NEAREST = TO_LEAP / 2.0
# Gap of closures at all nodes of a leap: eight units of rounding of their size.
TIGHT = 2.0**-50
# Length of the probe, in sizes: less than `NEAREST`, so that it stays on this side of the position, and more than 2^-4
# of the distance, which the pivots then show to nine digits.
PROBE = 2.0**-14
# Least distance of the next singular position, relative to that of the first, that is not leapt over together with it:
# a leap ends at twice the distance, and is then as far from the next position as it started from the first.
APART = 3.0
# Least distance after the position, relative to that before it, if the end of the run or segment cuts a leap short.
BEYOND = 0.25
# Constant c of a hyperbola x y = c that cannot be told from the gaps of closures: `TIGHT` times 2^8, which allows for
# port speeds that are sums over several bodies and for closures far from the origin. Smooth accelerations differ by
# the cube of the leap, far less. tests/flexmb/closure/test_near_singular.py measures the admissible range.
UNRESOLVED = 2.0**-42
# Evaluations by which the trapezoidal rule converges: one Euler step, then two iterations of the rule.
APPROACHES = 3


@kernel
def back(y, s):
    """Copy the last accepted state of the run to y; returns its time (s), -inf if there is none."""
    if s.cw.time[0] > -inf:
        for i in range(y.shape[0]):
            y[i] = s.cw.state[i]
    return s.cw.time[0]


@kernel
def leap(end, y, dy, y_new, dy_new, s):
    """Leap from the last accepted state of the run, y, over a singular position, not beyond time `end` (s).

    Returns the length of the leap (s), with slopes dy at y, which is first projected to round-off, and dy_new at y_new,
    which becomes the last accepted state. Returns 0 if there is no leap: no singular position is near enough, or the
    continuation is not clear.
    """
    cw, t = s.cw, s.cw.time[0]
    if not t > -inf:
        return 0.0
    recall(cw)
    h = _length(t, end, y, dy, y_new, s)
    if h > 0.0 and not _lands(t, h, y, dy, y_new, dy_new, s):
        h = 0.0
    if h > 0.0:
        cw.failure[0], cw.closer[0] = OK, 0
        if choose_rows(s.cc, cw) < 0 and factorise(s.cc, cw) < 0:
            remember(t + h, y_new, s.cc, cw)
            return h
    recall(cw)
    return 0.0


@kernel
def beside(t, y, dy, s):
    """dy at y near a singular position, on either side, y being projected to round-off first; returns a status code.

    Controllers use it, whose effect on a leap is known only afterwards: at its end, y becomes the last accepted state.
    """
    status = _slope(t, y, dy, s)
    if status == OK and t == s.cw.time[0]:
        remember(t, y, s.cc, s.cw)
    return status


@sweep
def _slope(t, y, dy, s):
    """dy at y after projection to round-off; returns a status code. R, Q and the loads then belong to y."""
    put_back(t, y, s.c)
    status = _tree(t, y, s)
    if status != OK:
        return status
    close(t, y, TIGHT, s)
    status = _tree(t, y, s)
    if status != OK:
        return status
    status = row_loads(s.w, s.cc, s.cw)
    if status == OK:
        accelerate(s.route, s)
        store_slope(s.c, s.w, power(s.c, s.w), dy)
    return status


@sweep
def _tree(t, y, s):
    load_state(t, y, s.c, s.w)
    status = free_tree(s.route, s)
    if status == OK and factorise(s.cc, s.cw) >= 0:
        return CLOSURE_SINGULAR
    return status


@helper
def _length(t, end, y, dy, trial, s):
    """Length of the leap (s): twice the time until the last of the nearby pivots vanishes, or to `end`; 0 for none.

    Writes to cw.vanishing (s) when each chosen row vanishes, inf for those that do not soon, and to cw.demand[0] the
    accelerations that the closures demand along the rows now.
    """
    cc, cw = s.cc, s.cw
    if _slope(t, y, dy, s) != OK:
        return 0.0
    probe = inf
    for g in range(cc.group.shape[0]):
        probe = min(probe, PROBE * passing_time(cc, cw, g))
    if not probe < inf:
        return 0.0
    _keep_demands(0, cc, cw)
    for i in range(y.shape[0]):
        trial[i] = y[i] + probe * dy[i]
    put_back(t + probe, trial, s.c)
    if _tree(t + probe, trial, s) != OK:
        return 0.0
    last, too_near = _vanish(probe, cc, cw)
    cw.closer[0] = 1 if last > 0.0 or _is_near(cc, cw) else 0
    h = min(2.0 * last, end - t)
    return 0.0 if too_near or h < (1.0 + BEYOND) * last else h


@helper
def _is_near(cc, cw):
    """Whether a singular position is within half of `LEAP`, by the part of the distance that the probe covers.

    The pivots alone do not show a near miss: they may rise again before the probe ends.
    """
    for g in range(cc.group.shape[0]):
        for a in range(cw.rank[g]):
            if covered(cc, cw, g, a) > 2.0 * PROBE / LEAP:
                return True
    return False


@helper
def _vanish(probe, cc, cw):
    """The last of the times (s) at which chosen rows vanish soon, 0 for none; and whether one of them is too near.

    Rows that vanish a little later are included: a leap must not end near another singular position.
    """
    last, too_near = 0.0, False
    for g in range(cc.group.shape[0]):
        moment = passing_time(cc, cw, g)
        for a in range(cw.rank[g]):
            place = cc.group[g].row_start + a
            before, after = cw.former_pivot[place], cw.factor[entry(cc, g, a, a)]
            if along(cc, cw, g, a) < 0.0:
                after = -after
            ahead = before * probe / (before - after) if before > after else inf
            cw.vanishing[place] = ahead
            if ahead < LEAP * moment:
                last = max(last, ahead)
                too_near = too_near or ahead < NEAREST * moment
    before = 0.0
    while before < last:
        before = last
        for g in range(cc.group.shape[0]):
            for place in range(cc.group[g].row_start, cc.group[g].row_start + cw.rank[g]):
                if cw.vanishing[place] < APART * before:
                    last = max(last, cw.vanishing[place])
    for g in range(cc.group.shape[0]):
        for place in range(cc.group[g].row_start, cc.group[g].row_start + cw.rank[g]):
            if cw.vanishing[place] > last:
                cw.vanishing[place] = inf
    return last, too_near


@helper
def _lands(t, h, y, dy, y_new, dy_new, s):
    """Whether there is a y_new on the same branch: by the trapezoidal rule, then by Lobatto's.

    Writes to cw.demand the accelerations that the closures demand at all four nodes.
    """
    for approach in range(APPROACHES):
        for i in range(y.shape[0]):
            slope = dy[i] if approach == 0 else 0.5 * (dy[i] + dy_new[i])
            y_new[i] = y[i] + h * slope
        if _slope(t + h, y_new, dy_new, s) != OK:
            return False
    inner, slope, total = np.empty(y.shape[0]), np.empty(y.shape[0]), np.empty(y.shape[0])
    for i in range(y.shape[0]):
        total[i] = EDGE_WEIGHT * (dy[i] + dy_new[i])
    for node, x in ((1, INNER), (2, 1.0 - INNER)):
        cubic(Interval(t, t + h, t + h), y, dy, y_new, dy_new, t + x * h, inner)
        if _slope(t + x * h, inner, slope, s) != OK:
            return False
        _keep_demands(node, s.cc, s.cw)
        for i in range(y.shape[0]):
            total[i] += INNER_WEIGHT * slope[i]
    for i in range(y.shape[0]):
        y_new[i] = y[i] + h * total[i]
    if _slope(t + h, y_new, dy_new, s) != OK:
        return False
    _keep_demands(3, s.cc, s.cw)
    return largest_gap(s.cc, s.cw)[0] <= OPEN and _same_branch(h, s.cc, s.cw)


@helper
def _same_branch(h, cc, cw):
    """Whether the rows that were predicted to vanish in the leap of h (s) are reversed: the third point above.

    The jump of the accelerations is compared with the effect of gaps at the node nearest to the singular position.
    """
    for g in range(cc.group.shape[0]):
        for a in range(cw.rank[g]):
            place = cc.group[g].row_start + a
            r = cw.chosen[place]
            turned, ahead = along(cc, cw, g, a), cw.vanishing[place]
            if not ahead < inf:
                if not turned >= TURNED:
                    return False
            else:
                expected = cw.former_pivot[place] * (h - ahead) / ahead
                factor = cw.factor[entry(cc, g, a, a)]
                if not (-turned >= TURNED and 0.5 * expected <= factor <= 2.0 * expected):
                    return False
                closure = cw.closure[cc.row[r].closure]
                least = min(abs(cw.demand[0, place]), abs(cw.demand[3, place]))
                usual = closure.speed**2 / closure.size + cw.size[r] * least
                moment = passing_time(cc, cw, g)
                nearest = min(ahead, abs(h - ahead), abs(INNER * h - ahead), abs((1.0 - INNER) * h - ahead)) / moment
                if not cw.size[r] * abs(_jump(cw, place)) * nearest**3 <= 8.0 * UNRESOLVED * usual:
                    return False
    return True


@helper
def _jump(cw, place):
    """Excess change of the acceleration along a row between the inner nodes over that beside them; 0 for a parabola."""
    d = cw.demand
    outside = 0.5 * (d[1, place] - d[0, place] + d[3, place] - d[2, place]) / INNER
    return d[2, place] - d[1, place] - (1.0 - 2.0 * INNER) * outside


@helper
def _keep_demands(node, cc, cw):
    """Store the accelerations demanded along the rows of Q, signed as at the first node: rows reverse in the leap."""
    for g in range(cc.group.shape[0]):
        for a in range(cw.rank[g]):
            demand = _demand(cc, cw, g, a)
            place = cc.group[g].row_start + a
            cw.demand[node, place] = -demand if node > 0 and along(cc, cw, g, a) < 0.0 else demand


@helper
def _demand(cc, cw, g, a):
    """Acceleration caused by the loads along row a of Q of group g: an element of R f."""
    total, first = 0.0, cc.group[g].row_start
    for b in range(a, cw.rank[g]):
        total += cw.factor[entry(cc, g, a, b)] * cw.row[cw.chosen[first + b]].load
    return total
