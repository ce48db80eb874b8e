"""Spatial vectors as values: motions V = (w, v) and A = (alpha, a), forces F = (tau, f), angular part first.

A spatial vector is a pair of 3-tuples of `flexmb.spatial.vector`. The compiler keeps all six components in registers,
so that operations on spatial vectors cost no more than on their components. Names end in 6 where vector.py has the same
operation for three components. phi is the shift operator of Jain and Rodriguez (4) from O to Q; d leads from Q to O.
"""

from flexmb.jit.kernel import helper
from flexmb.spatial.vector import add, add3, axpy, cross, dot, plus_cross, scale, store3, sub, times, times_t, vec3

ZERO6 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


@helper
def vec6(a, i):
    """Elements i .. i+5 of a 1-D array."""
    return vec3(a, i), vec3(a, i + 3)


@helper
def store6(a, i, V):
    store3(a, i, V[0])
    store3(a, i + 3, V[1])


@helper
def add6(a, i, V):
    """Add V to elements i .. i+5 of a 1-D array."""
    add3(a, i, V[0])
    add3(a, i + 3, V[1])


@helper
def sum6(V, W):
    """V + W."""
    return add(V[0], W[0]), add(V[1], W[1])


@helper
def sub6(V, W):
    """V - W."""
    return sub(V[0], W[0]), sub(V[1], W[1])


@helper
def scale6(s, V):
    return scale(s, V[0]), scale(s, V[1])


@helper
def axpy6(s, V, W):
    """s V + W."""
    return axpy(s, V[0], W[0]), axpy(s, V[1], W[1])


@helper
def dot6(V, F):
    """V' F: the power of a force on a motion."""
    return dot(V[0], F[0]) + dot(V[1], F[1])


@helper
def less6(s, V, F):
    """s - V' F, the angular part subtracted first (which fixes the rounding)."""
    return s - dot(V[0], F[0]) - dot(V[1], F[1])


@helper
def times6(R, V):
    """Components in axes A from components in axes B, with R = R_AB."""
    return times(R, V[0]), times(R, V[1])


@helper
def times6_t(R, V):
    """Components in axes B from components in axes A, with R = R_AB."""
    return times_t(R, V[0]), times_t(R, V[1])


@helper
def shift_motion(V, d):
    """phi' V: the velocity of the body's point O from its velocity at Q."""
    return V[0], plus_cross(V[1], V[0], d)


@helper
def shift_acceleration(A, V, d):
    """Acceleration of the body's point O from its velocity V and acceleration A at Q: phi' A + [0; w x (w x d)]."""
    return A[0], plus_cross(plus_cross(A[1], A[0], d), V[0], cross(V[0], d))


@helper
def shift_force(F, d):
    """phi F: a force about Q from the same force about O."""
    return plus_cross(F[0], d, F[1]), F[1]


@helper
def plus6(s, V, F):
    """s + V' F, the angular part added first (which fixes the rounding)."""
    return s + dot(V[0], F[0]) + dot(V[1], F[1])
