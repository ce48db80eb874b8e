"""Whether a run goes through a singular position, where a mechanism can go on along more than one branch.

The basis Q of the chosen rows, B P = Q R by Gram-Schmidt in a fixed order with positive pivots, turns as smoothly as
the mechanism moves. At a singular position a pivot passes zero, and beyond it what was left of that row points the
other way: the row of Q is turned over, in however short a step. Looking at pivots alone would miss it, since steps
jump over the place where they vanish.

So every evaluation of a step compares its Q with that of the state from which the step starts, row by row. A row that
has turned by more than 60 degrees has either been turned over or moved further than a step can tell. Methods that adapt
their steps try a shorter one, and so come ever closer to a singular position from one side, until nothing tells its
branches apart: at a distance of d sizes of the mechanism they differ by d^2 in the gap of the closure, which is closed
to 2^-44. So no step goes where a pivot falls so fast that it vanishes within `AT_CROSSING`, well above 2^-22.
What leads on, `flexmb.closure.leap`, starts from the last good state, which is kept here, and from further away: steps
come closer than `TO_LEAP` only where there was no leap.

Distances are in sizes of the mechanism. How far it moves in a step is the step over `passing_time`, in which ports move
by one size; how much of the distance to a singular position that is, `covered`, is seen by how rows change.

Errors of a step are powers of what it covers of the distance to a singular position, be it one that the mechanism only
passes. Methods that estimate their errors shorten their steps there; of others, whose steps are equal, those fail that
are too long for the distance (`unresolved`), or are noticed where they are not to be shortened (`notice`).
"""

from math import inf, sqrt

from flexmb.closure.factor import entry
from flexmb.closure.rows import largest_gap
from flexmb.jit.kernel import helper

# Cosine of the angle by which a row of Q may turn in a step. A near miss turns it by a right angle in all, and no step
# takes the whole of it.
TURNED = 0.5
# Leaps go from 2^-10 and are tried wherever a step fails: steps fail before they leave that range.
TO_LEAP = 2.0**-12
# There branches differ by 2^-40 in the gap of a closure: 16 times what closed closures are left open by.
AT_CROSSING = 2.0**-20
# Beyond this distance no leap goes: twice 2^-10.
AWAY = 2.0**-9
# What rounding may change a pivot by: 1e-12 of the responses of its ports, `flexmb.closure.sizes`.
ROUND_OFF = 2.0**-40
# Fall of a pivot, as part of its ports' response, while they move as far as the mechanism is large. A pivot is a sine
# of what turns, in that response, and falls by all of it in a radian; speeds that are added up make that half. What
# falls faster has been put right by a projection, whatever the step.
FASTEST = 2.0
# Of the distance to a singular position what a step of fixed length may cover. It errs by the fifth power of this part,
# 1e-6, times what is small in Runge's rule: 1e-8, and passing takes some 100 such steps.
RESOLVED = 2.0**-4
# Far from singular positions a step changes a row by less than what its mechanism moves, in its sizes: `passing_time`
# adds the ports' speeds up, several times the true one. Twice that is a distance below half of the size.
NEARBY = 2.0
# Of the distance no step covers more, however far its mechanism moves: the row could vanish within two of them.
HALF = 0.5
# What is noticed of steps that are not to be shortened: how far closures are open, and how long they are.
NOTHING, GAPS, GAPS_AND_LENGTHS = range(3)
# Root of the gap of a stabilised closure, over the distance to a singular position: branches differ by the square of
# the distance in the gap, and speeds that are added up make the distance pass for several times what it is.
CLEAR = 2.0**-5


def watch_steps(chain, shorter):
    """Of a method whose errors do not shorten its steps: let those fail that are too long near a singular position.

    Not where steps are those that the user gave, whatever they lead to: `shorter` is false, or closures are stabilised.
    There such steps are noticed.
    """
    if shorter and chain.cw.gain[0] == 0.0:
        chain.cw.resolved[0] = RESOLVED
    else:
        chain.cw.notices[0] = GAPS_AND_LENGTHS


def noticed(chain):
    """End (s) and closure of the step that was most too long for a singular position that it came near; or None."""
    _, t, closure = chain.cw.noticed
    return None if closure < 0.0 else (float(t), int(closure))


@helper
def has_started(cw):
    """Whether there is a state from which the step starts."""
    return cw.time[0] > -inf


@helper
def is_further(t, cw):
    """Whether time t is beyond the last state of the run: not a sample within its last step."""
    return t > cw.time[0]


@helper
def passing_time(cc, cw, g):
    """The least time (s) in which a closure of group g moves as far as it is large; inf at rest.

    Speeds are the larger ones of those now and of those where the step started: where a port turns back, it has none.
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
    """The first chosen row that is about to vanish, or -1. Needs `factorise`, and a state from which the step starts.

    At the rate at which it has fallen since the step started, a pivot vanishes after some time, which is compared with
    that in which its mechanism moves as far as it is large. What falls faster than ports move has been put right by the
    projection: of a mechanism that comes to rest that is all.
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
    """The first chosen row that points another way than when the step started, or -1. Needs the same."""
    for g in range(cc.group.shape[0]):
        for a in range(cw.rank[g]):
            if not along(cc, cw, g, a) >= TURNED:
                return cw.chosen[cc.group[g].row_start + a]
    return -1


@helper
def covered(cc, cw, g, a):
    """Part of the distance to where row a of group g vanishes that the step has covered.

    What is left of a row is a vector that vanishes at a singular position, R[a, a] times row a of Q. In terms of its
    length the step changes it by that part, whether the mechanism goes there or only passes.
    """
    start, own, stop = cc.group[g].column_start, cc.group[g].own_stop, cc.group[g].column_stop
    total, at = 0.0, cc.group[g].half + a * (stop - start)
    before, now = cw.former_pivot[cc.group[g].row_start + a], cw.factor[entry(cc, g, a, a)]
    for j in range(at, at + own - start):
        total += (now * cw.basis[j] - before * cw.former[j]) ** 2
    return sqrt(total) / min(before, now)


@helper
def may_cover(moved, resolved):
    """Part of the distance that a step may cover in which the mechanism has moved by so many of its sizes."""
    return min(max(resolved, NEARBY * moved), HALF)


@helper
def unresolved(t, cc, cw):
    """The first chosen row near whose vanishing the step is too long, or -1. Needs the same."""
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
    """Have steps keep their distance again once they have left a position that there was no leap over. Needs the same.
    """
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
    """Keep in cw.noticed that a step is taken that is too long near a singular position. Needs the same, and rows.

    Or that closures which are stabilised are open there so far that they could be on either of two branches.
    """
    if cw.notices[0] == NOTHING:
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
    """Take the state y, factorised last, for the one from which the next step starts."""
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
    """Choose the rows that were chosen where the step starts, to try it again."""
    if has_started(cw):
        for r in range(cw.chosen.shape[0]):
            cw.chosen[r] = cw.former_rows[r]
