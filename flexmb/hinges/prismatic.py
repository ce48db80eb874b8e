"""Prismatic: one translation along z."""

from flexmb.jit.kernel import helper

NQ, NV = 1, 1


@helper
def pose(q, i, sequence):
    return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, q[i])


@helper
def motion(q, i, u, j, sequence, H):
    H[5, 0] = 1.0
    zero = (0.0, 0.0, 0.0)
    return zero, (0.0, 0.0, u[j]), zero, zero


@helper
def rate(q, i, u, j, sequence, dq):
    dq[i] = u[j]
