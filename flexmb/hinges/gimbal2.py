"""Two successive rotations about carried axes (universal hinge: "xy"): R = R_a(q1) R_b(q2)."""

from flexmb.jit.kernel import helper
from flexmb.spatial.rotation import rotation_axis
from flexmb.spatial.vector import add, cross, matmul, scale, times_t

NQ, NV = 2, 2


@helper
def unit(axis):
    """Coordinate axis 0, 1 or 2 as a vector."""
    if axis == 0:
        return 1.0, 0.0, 0.0
    if axis == 1:
        return 0.0, 1.0, 0.0
    return 0.0, 0.0, 1.0


@helper
def pose(q, i, sequence):
    return (
        matmul(rotation_axis(sequence[0], q[i]), rotation_axis(sequence[1], q[i + 1])),
        (0.0, 0.0, 0.0),
    )


@helper
def motion(q, i, u, j, sequence, H):
    # Frisch's free coordinate vectors in outboard axes: the first axis is carried back through the second rotation
    second = unit(sequence[1])
    first = times_t(rotation_axis(sequence[1], q[i + 1]), unit(sequence[0]))
    for n in range(3):
        H[n, 0] = first[n]
        H[n, 1] = second[n]
    # in outboard axes the first axis turns with -second u2
    first_rate = cross(scale(-u[j + 1], second), first)
    zero = (0.0, 0.0, 0.0)
    return add(scale(u[j], first), scale(u[j + 1], second)), zero, scale(u[j], first_rate), zero


@helper
def rate(q, i, u, j, sequence, dq):
    dq[i] = u[j]
    dq[i + 1] = u[j + 1]
