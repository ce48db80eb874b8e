"""Spherical: q = quaternion of O relative to O+ (scalar first), u = relative angular velocity in O axes."""

from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import quaternion_matrix, quaternion_rate

NQ, NV = 4, 3


@helper
def pose(q, i, sequence):
    return quaternion_matrix(q[i], q[i + 1], q[i + 2], q[i + 3]), (0.0, 0.0, 0.0)


@helper
def motion(q, i, u, j, sequence, H):
    for n in range(3):
        H[n, n] = 1.0
    zero = (0.0, 0.0, 0.0)
    return (u[j], u[j + 1], u[j + 2]), zero, zero, zero


@helper
def rate(q, i, u, j, sequence, dq):
    dw, dx, dy, dz = quaternion_rate(q[i], q[i + 1], q[i + 2], q[i + 3], (u[j], u[j + 1], u[j + 2]))
    dq[i] = dw
    dq[i + 1] = dx
    dq[i + 2] = dy
    dq[i + 3] = dz
