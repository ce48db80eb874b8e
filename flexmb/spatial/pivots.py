"""Tests for pivots that may consist of rounding errors, by comparison with the sums from which elimination subtracted.

A pivot at the level of the rounding errors of its own diagonal, or of the inertia of its body, is zero to round-off:
the motion has no inertia. Rounding errors of bodies further out, or magnified on the way, are not seen by such a
comparison. A pivot that is small enough to consist of them is noted in w.doubt, which costs two comparisons; the caller
then computes the condition (`flexmb.jain.precision`).
"""

from flexmb.jit.kernel import helper
from flexmb.jit.lanes import every

SINGULAR = 2.0**-46  # 64 eps: a pivot below this fraction of its diagonal is a rounding error of zero
SMALL = 2.0**-20  # a pivot above this fraction of its diagonal is rounding only if errors were magnified by 2^32


@helper
def is_small(c, w, j, pivot, diagonal):
    """Whether a pivot of speed j is small relative to its diagonal before elimination, or to all that the speed moves.

    In lanes: whether it is so in any of them.
    """
    if every(pivot.real > c.speed[j].doubtful.real) and every(pivot.real > SMALL * diagonal.real):
        return False
    w.doubt[0] = 1
    return True


@helper
def is_inertia(pivot, made_of):
    """Whether a pivot is above the rounding errors of `made_of`, from which it was computed, and not NaN."""
    return pivot.real > SINGULAR * made_of.real
