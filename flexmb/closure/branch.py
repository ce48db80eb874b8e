"""Detection of singular positions, at which a mechanism can continue along more than one branch.

The basis Q of the chosen rows, B P = Q R by Gram-Schmidt in a fixed order with positive pivots, varies as smoothly as
the mechanism moves. At a singular position a pivot passes through zero, and beyond it the remainder of that row has the
opposite direction: the row of Q reverses, however short the step is. The pivots alone would not show this, since a step
jumps over the position where they vanish.

Therefore every evaluation in a step compares its Q row by row with that of the state from which the step starts. A row
that has turned by more than 60 degrees has either reversed or moved further than one step can resolve. Adaptive methods
then retry with a shorter step, and approach a singular position from one side until its branches can no longer be
distinguished: at a distance of d sizes of the mechanism they differ by d^2 in the gap of the closure, which is closed
to 2^-44. So a step is refused where a pivot falls so fast that it vanishes within `AT_CROSSING`, well above 2^-22. The
leap over the position (`flexmb.closure.leap`) starts from the last accepted state, which is stored here, and from
further away: steps come closer than `TO_LEAP` only if a leap was not possible.

Distances are measured in sizes of the mechanism. The motion in a step is the step divided by `passing_time`, the time
in which a port moves by one size. The part of the distance to a singular position that a step has `covered` follows
from the change of the rows.

The error of a step grows as a power of the part of the distance to a singular position that it covers, also where the
mechanism only passes near it. Methods with error estimates shorten their steps there. With fixed steps, a step that is
too long for the distance fails (`unresolved`) or, where the step size must not be changed, is recorded (`notice`).
"""

from math import inf, sqrt

from flexmb.closure.factor import entry
from flexmb.closure.rows import largest_gap
from flexmb.jit.kernel import helper

# Cosine of the largest angle by which a row of Q may turn in a step. Passing near a singular position turns it by a
# right angle in all, and no step makes the whole of this turn.
TURNED = 0.5
# Leaps start from a distance of up to 2^-10 and are tried whenever a step fails: steps must fail within that range.
TO_LEAP = 2.0**-12
# At this distance branches differ by 2^-40 in the gap of a closure: 16 times the gap of closed closures.
AT_CROSSING = 2.0**-20
# Leaps end within this distance: twice 2^-10.
AWAY = 2.0**-9
# Bound of the rounding error of a pivot, relative to the response of its ports: 1e-12, see `flexmb.closure.sizes`.
ROUND_OFF = 2.0**-40
# Largest decrease of a pivot, relative to its ports' response, while the ports move by one size of the mechanism. In
# units of that response a pivot is a sine, which falls by one within a radian; the sum of the ports' speeds makes that
# a half. A faster decrease is the effect of a projection, and does not depend on the step.
FASTEST = 2.0
# Part of the distance to a singular position that a step of fixed length may cover. Its error is the fifth power of
# this part, 1e-6, times the small error constant of the Runge-Kutta rule: 1e-8. Passing takes some 100 such steps.
RESOLVED = 2.0**-4
# Far from singular positions a step changes a row by less than the motion of its mechanism in sizes, since
# `passing_time` adds up the ports' speeds, several times the true one. A change of twice that motion means a distance
# of less than half the size.
NEARBY = 2.0
# Part of the distance that no step may exceed, however far its mechanism moves: the row could vanish within two steps.
HALF = 0.5
# What is recorded of steps that must not be shortened: the gaps of closures, and also the lengths of the steps.
UNRECORDED, GAPS, GAPS_AND_LENGTHS = range(3)
# Square root of the gap of a stabilised closure over the distance to a singular position: the gap between branches is
# the square of the distance, and the sum of the ports' speeds overestimates the distance several times.
CLEAR = 2.0**-5


def watch_steps(chain, shorter):
    """For a method without error control: make steps fail that are too long near a singular position.

    If the step size is fixed by the user (`shorter` is false) or closures are stabilised, such steps are only recorded.
    """
    if shorter and chain.cw.gain[0] == 0.0:
        chain.cw.resolved[0] = RESOLVED
    else:
        chain.cw.notices[0] = GAPS_AND_LENGTHS


def noticed(chain):
    """End (s) and closure of the step that was the worst resolved near a singular position, or None."""
    _, t, closure = chain.cw.noticed
    return None if closure < 0.0 else (float(t), int(closure))


@helper
def has_started(cw):
    """Whether there is a state from which the step starts."""
    return cw.time[0] > -inf


@helper
def is_further(t, cw):
    """Whether time t is after the last accepted state, and so is no sample within the last step."""
    return t > cw.time[0]


@helper
def passing_time(cc, cw, g):
    """The least time (s) in which a closure of group g moves by its own size; inf at rest.

    The larger of the speeds now and at the start of the step is taken, since the speed is zero where a port turns back.
    """
    least = inf
    for r in range(cc.group[g].row_start, cc.group[g].row_stop):
        closure = cw.closure[cc.row[r].closure]
        speed = max(closure.speed, closure.former_speed)
        if speed > 0.0:
            least = min(least, closure.size / speed)
    return least


@helper
def at_crossing(t, cc, cw):
    """The first chosen row that is about to vanish, or -1. Requires `factorise` and the state at the start of the step.

    The time until a pivot vanishes, at the rate of its decrease since the start of the step, is compared with the time
    in which the mechanism moves by its own size. A pivot that falls faster than the ports move was changed by the
    projection; in a mechanism that comes to rest, that is the only change.
    """
    near = AT_CROSSING if cw.closer[0] != 0 else TO_LEAP
    for g in range(cc.group.shape[0]):
        moment, passed = passing_time(cc, cw, g), t - cw.time[0]
        for a in range(cw.rank[g]):
            place = cc.group[g].row_start + a
            r = cw.chosen[place]
            left = cw.factor[entry(cc, g, a, a)]
            fallen = cw.former_pivot[place] - (1.0 + ROUND_OFF) * left
            moved = moment * cc.weight[r] * fallen < FASTEST * passed * cw.size[r]
            if moved and left * passed < near * moment * fallen:
                return r
    return -1


@helper
def along(cc, cw, g, a):
    """Cosine of the angle by which row a of Q of group g has turned since the step started."""
    start, own, stop = cc.group[g].column_start, cc.group[g].own_stop, cc.group[g].column_stop
    total, at = 0.0, cc.group[g].half + a * (stop - start)
    for j in range(at, at + own - start):
        total += cw.basis[j] * cw.former[j]
    return total


@helper
def turned_over(cc, cw):
    """The first chosen row that has reversed since the step started, or -1. Requires the same as `at_crossing`."""
    for g in range(cc.group.shape[0]):
        for a in range(cw.rank[g]):
            if not along(cc, cw, g, a) >= TURNED:
                return cw.chosen[cc.group[g].row_start + a]
    return -1


@helper
def covered(cc, cw, g, a):
    """Part of the distance to the position where row a of group g vanishes that the step has covered.

    The remainder of a row, R[a, a] times row a of Q, vanishes at a singular position. Its change in the step relative
    to its length is this part, whether the mechanism reaches the position or only passes near it.
    """
    start, own, stop = cc.group[g].column_start, cc.group[g].own_stop, cc.group[g].column_stop
    total, at = 0.0, cc.group[g].half + a * (stop - start)
    before, now = cw.former_pivot[cc.group[g].row_start + a], cw.factor[entry(cc, g, a, a)]
    for j in range(at, at + own - start):
        total += (now * cw.basis[j] - before * cw.former[j]) ** 2
    return sqrt(total) / min(before, now)


@helper
def may_cover(moved, resolved):
    """Part of the distance that a step may cover if the mechanism has moved by `moved` of its sizes in it."""
    return min(max(resolved, NEARBY * moved), HALF)


@helper
def unresolved(t, cc, cw):
    """The first chosen row for whose singular position the step is too long, or -1. Requires the same."""
    if cw.resolved[0] == 0.0:
        return -1
    for g in range(cc.group.shape[0]):
        most = may_cover((t - cw.time[0]) / passing_time(cc, cw, g), cw.resolved[0])
        for a in range(cw.rank[g]):
            if not covered(cc, cw, g, a) <= most:
                return cw.chosen[cc.group[g].row_start + a]
    return -1


@helper
def leave(t, cc, cw):
    """Restore the minimum distance of steps once they have left a position that no leap passed. Requires the same."""
    if cw.closer[0] == 0:
        return
    for g in range(cc.group.shape[0]):
        moved = (t - cw.time[0]) / passing_time(cc, cw, g)
        for a in range(cw.rank[g]):
            if not covered(cc, cw, g, a) * AWAY <= moved:
                return
    cw.closer[0] = 0


@helper
def notice(t, cc, cw):
    """Record in cw.noticed a step that is too long near a singular position. Requires the same, and evaluated rows.

    Also recorded are gaps of stabilised closures there that are so large that the branch is ambiguous.
    """
    if cw.notices[0] == UNRECORDED:
        return
    gap = largest_gap(cc, cw)[0]
    for g in range(cc.group.shape[0]):
        moved = (t - cw.time[0]) / passing_time(cc, cw, g)
        for a in range(cw.rank[g]):
            part = covered(cc, cw, g, a)
            excess = part / may_cover(moved, RESOLVED) if cw.notices[0] == GAPS_AND_LENGTHS else 0.0
            if moved > 0.0:
                excess = max(excess, sqrt(gap) / (CLEAR * moved) * part)
            if excess > cw.noticed[0]:
                cw.noticed[0], cw.noticed[1] = excess, t
                cw.noticed[2] = cc.row[cw.chosen[cc.group[g].row_start + a]].closure


@helper
def remember(t, y, cc, cw):
    """Store the state y, factorised last, as the start of the next step."""
    cw.time[0] = t
    for i in range(y.shape[0]):
        cw.state[i] = y[i]
    for i in range(cw.closure.shape[0]):
        cw.closure[i].former_speed = cw.closure[i].speed
    for r in range(cw.chosen.shape[0]):
        cw.former_rows[r] = cw.chosen[r]
    for j in range(cw.basis.shape[0]):
        cw.former[j] = cw.basis[j]
    for g in range(cc.group.shape[0]):
        for a in range(cw.rank[g]):
            cw.former_pivot[cc.group[g].row_start + a] = cw.factor[entry(cc, g, a, a)]


@helper
def recall(cw):
    """Restore the rows that were chosen at the start of the step, to retry it."""
    if has_started(cw):
        for r in range(cw.chosen.shape[0]):
            cw.chosen[r] = cw.former_rows[r]
