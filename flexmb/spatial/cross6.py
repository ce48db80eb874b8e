"""Cross products of spatial vectors, for motions and forces about one point that is fixed at this instant.

In this form accelerations are those of a field of velocity, not of a point: with the classical acceleration a of the
point where v is taken, A = (alpha, a - w x v). They are shifted like velocities.
"""

from flexmb.jit.kernel import helper
from flexmb.spatial.vector import cross, plus_cross


@helper
def motion_cross(V, W):
    """V x W: the rate of a motion W whose components are constant in axes that move with V."""
    return cross(V[0], W[0]), plus_cross(cross(V[0], W[1]), V[1], W[0])


@helper
def force_cross(V, F):
    """V x* F: the rate of a force F whose components are constant in axes that move with V."""
    return plus_cross(cross(V[0], F[0]), V[1], F[1]), cross(V[0], F[1])
