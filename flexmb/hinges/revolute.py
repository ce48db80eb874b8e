"""Revolute: one rotation about z."""

from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import rotation_z

NQ, NV = 1, 1


@helper
def pose(q, i, sequence):
    return rotation_z(q[i]), (0.0, 0.0, 0.0)


@helper
def motion(q, i, u, j, sequence, H):
    H[2, 0] = 1.0
    zero = (0.0, 0.0, 0.0)
    return (0.0, 0.0, u[j]), zero, zero, zero


@helper
def rate(q, i, u, j, sequence, dq):
    dq[i] = u[j]
