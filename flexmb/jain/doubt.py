"""Pivots of the recursion that are so small that they may consist of rounding errors: noted in w.doubt."""

from flexmb.jit.kernel import helper
from flexmb.jit.lanes import every
from flexmb.spatial.pivots import is_small


@helper
def note_mode(c, w, k, n, pivot):
    """Note the pivot of mode n of body k if it is small."""
    if not every(pivot.real > c.speed[c.body[k].etad_index + n].doubtful.real):
        w.doubt[0] = 1


@helper
def note_hinge(c, w, k, L, first):
    """Note small pivots of the free speeds of hinge k, which have the rows of a Cholesky factor L from `first` on."""
    for a in range(w.body[k].free_count):
        diagonal = 0.0  # of D before the elimination, recovered from L L': the factor has overwritten it
        for b in range(first + a + 1):
            diagonal += L[first + a, b] * L[first + a, b]
        j = c.body[k].u_index + w.hinge[k].free_speed[a]
        is_small(c, w, j, L[first + a, first + a] * L[first + a, first + a], diagonal)
