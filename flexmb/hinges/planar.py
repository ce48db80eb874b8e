"""Planar: translation in the x-y plane of O+, then rotation about z; q = [x, y, angle]."""

from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import rotation_z
from flexmb.spatial.scalar import cos, sin

NQ, NV = 3, 3


@helper
def pose(q, i, sequence):
    return rotation_z(q[i + 2]), (q[i], q[i + 1], 0.0)


@helper
def motion(q, i, u, j, sequence, H):
    c = cos(q[i + 2])
    s = sin(q[i + 2])
    H[3, 0] = c
    H[4, 0] = -s
    H[3, 1] = s
    H[4, 1] = c
    H[2, 2] = 1.0
    # seen from O+ the directions of x and y do not turn: no bias
    zero = (0.0, 0.0, 0.0)
    return (0.0, 0.0, u[j + 2]), (c * u[j] + s * u[j + 1], -s * u[j] + c * u[j + 1], 0.0), zero, zero


@helper
def rate(q, i, u, j, sequence, dq):
    for n in range(3):
        dq[i + n] = u[j + n]
