"""Whether a run has gone through a singular position, where a mechanism can go on along more than one branch.

The basis Q of the chosen rows, B P = Q R by Gram-Schmidt in a fixed order with positive pivots, turns as smoothly as
the mechanism moves. At a singular position a pivot passes zero, and beyond it what was left of that row points the
other way: the row of Q is turned over, in however short a step. Looking at pivots alone would miss it, since steps
jump over the place where they vanish.

So every evaluation of a step compares its Q with that of the state from which the step starts, row by row. A row that
has turned by more than 60 degrees has either been turned over or moved further than a step can tell; methods that adapt
their steps try a shorter one, and end where none is short enough.
"""

from math import inf

from flexmb.kernel import helper

AT_CROSSING = 2.0**-20  # beside its size a pivot this small is that of a singular position: branches are closed alike there
TURNED = 0.5  # cosine of the angle by which a row of Q may turn in a step


@helper
def has_started(cw):
    """Whether there is a state from which the step starts."""
    return cw.time[0] > -inf


@helper
def lost(t, cc, cw):
    """The first chosen row that does not tell the branch on which the step started, or -1. Needs `factorise`."""
    for a in range(cw.rank[0]):
        row = cw.chosen[a]
        if not cc.weight[row] * cw.factor[a, a] > AT_CROSSING * cw.size[row]:
            return row
    if has_started(cw) and is_further(t, cw):
        for a in range(cw.rank[0]):
            total = 0.0
            for j in range(cw.basis.shape[1]):
                total += cw.basis[a, j] * cw.former[a, j]
            if not total >= TURNED:
                return cw.chosen[a]
    return -1


@helper
def is_further(t, cw):
    """Whether time t is beyond the last state of the run: not a sample within its last step."""
    return t > cw.time[0]


@helper
def remember(t, cw):
    """Take the state that was factorised last for the one from which the next step starts."""
    cw.time[0] = t
    for r in range(cw.chosen.shape[0]):
        cw.former_rows[r] = cw.chosen[r]
    for a in range(cw.rank[0]):
        for j in range(cw.basis.shape[1]):
            cw.former[a, j] = cw.basis[a, j]


@helper
def recall(cw):
    """Rows as they were chosen where the step starts, to try it again."""
    if has_started(cw):
        for r in range(cw.chosen.shape[0]):
            cw.chosen[r] = cw.former_rows[r]
