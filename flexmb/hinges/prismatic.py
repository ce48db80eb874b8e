"""Prismatic: one translation along z."""

from flexmb.hinges.kind import Item, Reduced, scalar_hinge, z_to
from flexmb.jit.kernel import helper
from flexmb.scene.schema import PointMass, Prismatic
from flexmb.tables.arrays import LINEAR_Z


@helper
def pose(q, i, sequence, parameters):
    return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, q[i])


@helper
def motion(q, i, u, j, sequence, parameters, H):
    H[5, 0] = 1.0
    zero = (0.0, 0.0, 0.0)
    return (zero, (0.0, 0.0, u[j])), (zero, zero)


def reduced(item: Item) -> Reduced | None:
    """Prismatic hinges, and point masses of one direction."""
    match item:
        case Prismatic(axis=axis) | PointMass(directions=(axis,)):
            return Reduced(turn=z_to(axis))
    return None


HINGE = scalar_hinge("prismatic", 1, pose=pose, motion=motion, reduced=reduced, axis=LINEAR_Z, displacements=(0,))
