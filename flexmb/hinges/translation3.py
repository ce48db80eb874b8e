"""Three translations along the axes of O+ (a point mass free in space)."""

from flexmb.jit.kernel import helper

NQ, NV = 3, 3


@helper
def pose(q, i, sequence):
    return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (q[i], q[i + 1], q[i + 2])


@helper
def motion(q, i, u, j, sequence, H):
    for n in range(3):
        H[3 + n, n] = 1.0
    zero = (0.0, 0.0, 0.0)
    return zero, (u[j], u[j + 1], u[j + 2]), zero, zero


@helper
def rate(q, i, u, j, sequence, dq):
    for n in range(3):
        dq[i + n] = u[j + n]
