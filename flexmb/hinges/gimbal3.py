"""Three successive rotations about carried axes: R = R_a(q1) R_b(q2) R_c(q3). Singular where a and c align."""

from flexmb.hinges.gimbal2 import axis_numbers, unit
from flexmb.hinges.kind import Item, Reduced, scalar_hinge
from flexmb.jit.kernel import helper
from flexmb.scene.schema import Gimbal
from flexmb.spatial.rotation import rotation_axis
from flexmb.spatial.vector import add, cross, matmul, scale, times_t


@helper
def pose(q, i, sequence, parameters):
    inner = matmul(rotation_axis(sequence[1], q[i + 1]), rotation_axis(sequence[2], q[i + 2]))
    return matmul(rotation_axis(sequence[0], q[i]), inner), (0.0, 0.0, 0.0)


@helper
def motion(q, i, u, j, sequence, parameters, H):
    third_turn = rotation_axis(sequence[2], q[i + 2])
    third = unit(sequence[2])
    second = times_t(third_turn, unit(sequence[1]))
    first = times_t(third_turn, times_t(rotation_axis(sequence[1], q[i + 1]), unit(sequence[0])))
    for n in range(3):
        H[n, 0] = first[n]
        H[n, 1] = second[n]
        H[n, 2] = third[n]
    # in outboard axes an axis turns with minus the rotations that come after it
    after_second = scale(-u[j + 2], third)
    after_first = add(after_second, scale(-u[j + 1], second))
    bias = add(scale(u[j], cross(after_first, first)), scale(u[j + 1], cross(after_second, second)))
    w = add(add(scale(u[j], first), scale(u[j + 1], second)), scale(u[j + 2], third))
    zero = (0.0, 0.0, 0.0)
    return (w, zero), (bias, zero)


def reduced(item: Item) -> Reduced | None:
    """Gimbals of three axes."""
    match item:
        case Gimbal(sequence=sequence) if len(sequence) == 3:
            return Reduced(axis_numbers(sequence))
    return None


HINGE = scalar_hinge("gimbal3", 3, pose=pose, motion=motion, reduced=reduced)
