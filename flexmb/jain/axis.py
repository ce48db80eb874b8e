"""Kinematics of hinges with a single axis along z, without the zeros and ones of their rotation and their map H.

Most hinges are of this kind. The kinematics of the revolute and the prismatic hinge of `flexmb.hinges` are repeated
here without products with zero: the compiler may not remove these itself, because 0 times infinity is NaN.
`flexmb.jain.hinge_solve` eliminates such hinges.
"""

from flexmb.jit.features import has
from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import turned_about_z
from flexmb.spatial.scalar import sines
from flexmb.spatial.vector import axpy
from flexmb.tables.arrays import ANGULAR_Z, LINEAR_Z, NO_AXIS
from flexmb.tables.features import AXIS

TURNING, SLIDING, OTHERS = (f"{AXIS} {row}" for row in (ANGULAR_Z, LINEAR_Z, NO_AXIS))  # features of a scene


@helper
def has_axis(c, k):
    """Whether hinge k has a single axis; known at compile time in scenes where all have one, or none has."""
    if not has(c, OTHERS):
        return True
    if not has(c, TURNING) and not has(c, SLIDING):
        return False
    return c.body[k].axis >= 0


@helper
def turns(c, k):
    """Whether the single axis of hinge k is one of rotation."""
    if not has(c, SLIDING):
        return True
    return c.body[k].axis == ANGULAR_Z


@helper
def turn(c, w):
    """Sines and cosines of all angles, for `pose`: in one call, which computes eight at a time in vector registers."""
    if not has(c, TURNING):
        return
    for k in range(c.body.shape[0]):
        if has_axis(c, k) and turns(c, k):
            w.angle[k] = w.q[c.body[k].q_index]
    sines(w.angle, w.sine, w.cosine, c.body.shape[0])


@helper
def pose(c, w, k, R, arm):
    """R_parent_O and the arm to O, in parent axes, from those of the inboard frame O+."""
    if turns(c, k):
        return turned_about_z(R, w.cosine[k], w.sine[k]), arm
    return R, axpy(w.q[c.body[k].q_index], (R[2], R[5], R[8]), arm)


@helper
def cross_hinge(c, w, k, V, A):
    """Velocity and bias of O from those of the coincident point of the parent, in outboard axes.

    V + H u, and the Coriolis acceleration A + [omega x w_rel; 2 omega x v_rel] of (25).
    """
    u = w.u[c.body[k].u_index]
    (x, y, z), v = V
    alpha, a = A
    if turns(c, k):
        return ((x, y, z + u), v), ((alpha[0] + u * y, alpha[1] - u * x, alpha[2]), a)
    return ((x, y, z), (v[0], v[1], v[2] + u)), (alpha, (a[0] + 2.0 * u * y, a[1] - 2.0 * u * x, a[2]))


@helper
def column(c, k):
    """H': the velocity [angular; linear] of O at unit speed of the hinge, in outboard axes."""
    if turns(c, k):
        return (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    return (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)


@helper
def along(c, k, F):
    """H F: the component of a force F = (torque, force) along the axis."""
    return F[0][2] if turns(c, k) else F[1][2]


@helper
def move_along(c, k, A, rate):
    """A + H' rate, the rate of the hinge's speed added to an acceleration A."""
    alpha, a = A
    if turns(c, k):
        return (alpha[0], alpha[1], alpha[2] + rate), a
    return alpha, (a[0], a[1], a[2] + rate)
