"""Weld: no freedom."""

from flexmb.jit.kernel import helper

NQ, NV = 0, 0


@helper
def pose(q, i, sequence):
    return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


@helper
def motion(q, i, u, j, sequence, H):
    zero = (0.0, 0.0, 0.0)
    return zero, zero, zero, zero


@helper
def rate(q, i, u, j, sequence, dq):
    pass
