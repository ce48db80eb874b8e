"""Two successive rotations about carried axes (universal hinge: "xy"): R = R_a(q1) R_b(q2)."""

from flexmb.hinges.kind import Item, Reduced, scalar_hinge
from flexmb.jit.kernel import helper
from flexmb.scene.schema import Gimbal, Universal
from flexmb.spatial.rotation import rotation_axis
from flexmb.spatial.vector import add, cross, matmul, scale, times_t


@helper
def unit(axis):
    """Coordinate axis 0, 1 or 2 as a vector."""
    if axis == 0:
        return 1.0, 0.0, 0.0
    if axis == 1:
        return 0.0, 1.0, 0.0
    return 0.0, 0.0, 1.0


def axis_numbers(sequence: str) -> tuple[int, ...]:
    """Axis numbers of "xyz" and the like."""
    return tuple("xyz".index(axis) for axis in sequence)


@helper
def pose(q, i, sequence, parameters):
    return (
        matmul(rotation_axis(sequence[0], q[i]), rotation_axis(sequence[1], q[i + 1])),
        (0.0, 0.0, 0.0),
    )


@helper
def motion(q, i, u, j, sequence, parameters, H):
    # Frisch's free coordinate vectors in outboard axes: the first axis is carried back through the second rotation
    second = unit(sequence[1])
    first = times_t(rotation_axis(sequence[1], q[i + 1]), unit(sequence[0]))
    for n in range(3):
        H[n, 0] = first[n]
        H[n, 1] = second[n]
    # in outboard axes the first axis turns with -second u2
    first_rate = cross(scale(-u[j + 1], second), first)
    zero = (0.0, 0.0, 0.0)
    return (add(scale(u[j], first), scale(u[j + 1], second)), zero), (scale(u[j], first_rate), zero)


def reduced(item: Item) -> Reduced | None:
    """Universal hinges, and gimbals of two axes."""
    match item:
        case Universal():
            return Reduced((0, 1))
        case Gimbal(sequence=sequence) if len(sequence) == 2:
            return Reduced(axis_numbers(sequence))
    return None


HINGE = scalar_hinge("gimbal2", 2, pose=pose, motion=motion, reduced=reduced)
