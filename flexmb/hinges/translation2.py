"""Two translations along x and y of O+ (a point mass free in a plane)."""

from flexmb.jit.kernel import helper

NQ, NV = 2, 2


@helper
def pose(q, i, sequence):
    return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (q[i], q[i + 1], 0.0)


@helper
def motion(q, i, u, j, sequence, H):
    H[3, 0] = 1.0
    H[4, 1] = 1.0
    zero = (0.0, 0.0, 0.0)
    return zero, (u[j], u[j + 1], 0.0), zero, zero


@helper
def rate(q, i, u, j, sequence, dq):
    dq[i] = u[j]
    dq[i + 1] = u[j + 1]
