"""Cylindrical: rotation about z and translation along z; q = [angle, displacement]."""

from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import rotation_z

NQ, NV = 2, 2


@helper
def pose(q, i, sequence):
    return rotation_z(q[i]), (0.0, 0.0, q[i + 1])


@helper
def motion(q, i, u, j, sequence, H):
    H[2, 0] = 1.0
    H[5, 1] = 1.0
    zero = (0.0, 0.0, 0.0)
    return (0.0, 0.0, u[j]), (0.0, 0.0, u[j + 1]), zero, zero


@helper
def rate(q, i, u, j, sequence, dq):
    dq[i] = u[j]
    dq[i + 1] = u[j + 1]
