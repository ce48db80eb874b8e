"""Pivots of the recursion that may be rounding, against the inertia of their body before it was eliminated."""

from flexmb.jain.kinematics import motion_column
from flexmb.kernel import helper
from flexmb.pivots import is_rounding, is_small
from flexmb.spatial.vector import dot


@helper
def trace(w, k, angular):
    """Of the angular or linear block of P before elimination."""
    P = w.body[k].inertia
    return P[0] + P[1] + P[2] if angular else P[15] + P[16] + P[17]


@helper
def are_rounding(c, w, k, D, first):
    """Whether a pivot of hinge k is; they are those of the free speeds, from row `first` on of a Cholesky factor D."""
    for a in range(w.body[k].free_count):
        row, n = D[first + a], w.body[k].free_speed[a]
        diagonal = 0.0
        for b in range(first + a + 1):
            diagonal += row[b] * row[b]
        pivot = row[first + a] * row[first + a]
        if is_small(c, w, c.body[k].u_index + n, pivot, diagonal):
            angular, linear = motion_column(c, w, k, n)
            made_of = trace(w, k, True) * dot(angular, angular) + trace(w, k, False) * dot(linear, linear)
            if is_rounding(pivot, made_of):
                return True
    return False


@helper
def note_modes(c, w, k, L):
    """Note small pivots of the modes of body k, of a Cholesky factor L."""
    for n in range(c.body[k].modes):
        if not (L[n, n] * L[n, n]).real > c.speed[c.body[k].etad_index + n].doubtful:
            w.doubt[0] = 1
