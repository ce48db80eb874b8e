"""Pivots that may be rounding: what elimination left of an inertia, against what it was summed from.

A pivot at the level of rounding of its own diagonal, or of the inertia of its body, is none: the motion has no inertia.
Rounding that came from further out, or was magnified on its way, no such comparison tells. A pivot small enough for
that is noted in w.doubt, at the cost of two comparisons, and the caller asks `flexmb.jain.precision`.
"""

from flexmb.jit.kernel import helper
from flexmb.jit.lanes import every

SINGULAR = 2.0**-46  # a pivot this far below its diagonal is what rounding left of a zero: 64 roundings of the diagonal
SMALL = 2.0**-20  # of the diagonal: rounding must have been magnified as many times to be all that a larger pivot is


@helper
def is_small(c, w, j, pivot, diagonal):
    """Whether a pivot of speed j is small beside its diagonal before elimination, or all that the speed moves.

    Of lanes: of one at least.
    """
    if every(pivot.real > c.speed[j].doubtful) and every(pivot.real > SMALL * diagonal.real):
        return False
    w.doubt[0] = 1
    return True


@helper
def is_inertia(pivot, made_of):
    """Whether a pivot is above the rounding of what it was made of (and no NaN)."""
    return pivot.real > SINGULAR * made_of.real
