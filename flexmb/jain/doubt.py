"""Pivots of the recursion that may be rounding, by body: noted in w.doubt."""

from flexmb.jit.kernel import helper
from flexmb.jit.lanes import every
from flexmb.spatial.pivots import is_small


@helper
def note_mode(c, w, k, n, pivot):
    """Note the pivot of mode n of body k if it is small."""
    if not every(pivot.real > c.speed[c.body[k].etad_index + n].doubtful):
        w.doubt[0] = 1


@helper
def note_hinge(c, w, k, L, first):
    """Note small pivots of the free speeds of hinge k, from row `first` on of a Cholesky factor L."""
    for a in range(w.body[k].free_count):
        diagonal = 0.0
        for b in range(first + a + 1):
            diagonal += L[first + a, b] * L[first + a, b]
        j = c.body[k].u_index + w.hinge[k].free_speed[a]
        is_small(c, w, j, L[first + a, first + a] * L[first + a, first + a], diagonal)
