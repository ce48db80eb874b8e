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

Errors of a step are powers of what it covers of the distance to a singular position, be it one that the mechanism only
passes. Methods that estimate their errors shorten their steps there; of others, whose steps are equal, those fail that
are too long for the distance (`unresolved`).
"""

from math import inf

from flexmb.closure.factor import entry
from flexmb.jit.kernel import helper

# Cosine of the angle by which a row of Q may turn in a step. A near miss turns it by a right angle in all, and no step
# takes the whole of it.
TURNED = 0.5
# Leaps go from 2^-10 and are tried wherever a step fails: steps fail before they leave that range.
TO_LEAP = 2.0**-12
# There branches differ by 2^-40 in the gap of a closure: 16 times what closed closures are left open by.
AT_CROSSING = 2.0**-20
# What rounding may change a pivot by: 1e-12 of the responses of its ports, `flexmb.closure.sizes`.
ROUND_OFF = 2.0**-40
# Fall of a pivot, as part of its ports' response, while they move as far as the mechanism is large. Not derived: random
# mechanisms with masses six decades apart pass with it (tests/flexmb/closure/near_singular.py).
FASTEST = 2.0**10
# Of the distance to a singular position what a step of fixed length may cover. It errs by the fifth power of this part,
# 1e-6, times what is small in Runge's rule: 1e-8, and passing takes some 100 such steps.
RESOLVED = 2.0**-4
# Far from singular positions a step changes a row by less than what its mechanism moves, in its sizes: `passing_time`
# adds the ports' speeds up, several times the true one. Twice that is a distance below half of the size.
NEARBY = 2.0
# Of the distance no step covers more, however far its mechanism moves: the row could vanish within two of them.
HALF = 0.5


def watch_steps(chain):
    """Let steps fail that are too long near a singular position: of a method whose errors do not shorten them.

    Not where closures are stabilised: there steps are those that the user gave, also where these make gaps grow.
    """
    if chain.cw.gain[0] == 0.0:
        chain.cw.resolved[0] = RESOLVED


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
def unresolved(t, cc, cw):
    """The first chosen row of which the step has changed too much, or -1: near a singular position. Needs the same.

    What is left of a row is a vector that vanishes at the position, R[a, a] times row a of Q. In terms of its length
    the step changes it by what it covers of the distance, whether the mechanism goes there or only passes.
    """
    if cw.resolved[0] == 0.0:
        return -1
    for g in range(cc.group.shape[0]):
        moved = (t - cw.time[0]) / passing_time(cc, cw, g)
        most = min(max(cw.resolved[0], NEARBY * moved), HALF)
        for a in range(cw.rank[g]):
            place = cc.group[g].row_start + a
            before, now = cw.former_pivot[place], cw.factor[entry(cc, g, a, a)]
            changed = (now - before) ** 2 + 2.0 * before * now * (1.0 - along(cc, cw, g, a))
            if not changed <= (most * min(before, now)) ** 2:
                return cw.chosen[place]
    return -1


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
