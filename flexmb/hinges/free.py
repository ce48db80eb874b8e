"""Free: q = [position of O in O+ axes, quaternion], u = [angular velocity; velocity of O], both in O axes."""

from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import quaternion_matrix, quaternion_rate
from flexmb.spatial.scalar import sqrt
from flexmb.spatial.vector import cross, times

NQ, NV = 7, 6


@helper
def _attitude(q, i):
    return quaternion_matrix(q[i + 3], q[i + 4], q[i + 5], q[i + 6])


@helper
def pose(q, i, sequence):
    return _attitude(q, i), (q[i], q[i + 1], q[i + 2])


@helper
def motion(q, i, u, j, sequence, H):
    for n in range(6):
        H[n, n] = 1.0
    w = (u[j], u[j + 1], u[j + 2])
    v = (u[j + 3], u[j + 4], u[j + 5])
    # v is held in turning axes: seen from O+ it changes by w x v
    return w, v, (0.0, 0.0, 0.0), cross(w, v)


@helper
def rate(q, i, u, j, sequence, dq):
    """The quaternion enters the position rate normalised, so that scaling it scales only its own rate."""
    n2 = q[i + 3] * q[i + 3] + q[i + 4] * q[i + 4] + q[i + 5] * q[i + 5] + q[i + 6] * q[i + 6]
    s = 1.0 / sqrt(n2)
    r = quaternion_matrix(s * q[i + 3], s * q[i + 4], s * q[i + 5], s * q[i + 6])
    velocity = times(r, (u[j + 3], u[j + 4], u[j + 5]))
    for n in range(3):
        dq[i + n] = velocity[n]
    dw, dx, dy, dz = quaternion_rate(q[i + 3], q[i + 4], q[i + 5], q[i + 6], (u[j], u[j + 1], u[j + 2]))
    dq[i + 3] = dw
    dq[i + 4] = dx
    dq[i + 5] = dy
    dq[i + 6] = dz
