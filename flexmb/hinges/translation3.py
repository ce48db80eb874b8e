"""Three translations along the axes of O+ (a point mass free in space)."""

import numpy as np

from flexmb.hinges.kind import Item, Reduced, scalar_hinge
from flexmb.jit.kernel import helper
from flexmb.scene.schema import PointMass


@helper
def pose(q, i, sequence, parameters):
    return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (q[i], q[i + 1], q[i + 2])


@helper
def motion(q, i, u, j, sequence, parameters, H):
    for n in range(3):
        H[3 + n, n] = 1.0
    zero = (0.0, 0.0, 0.0)
    return (zero, (u[j], u[j + 1], u[j + 2])), (zero, zero)


def reduced(item: Item) -> Reduced | None:
    """Point masses of three directions: the first two become x and y."""
    match item:
        case PointMass(directions=(x, y, _)):
            return Reduced(turn=np.column_stack([x, y, np.cross(x, y)]))
    return None


HINGE = scalar_hinge("translation3", 3, pose=pose, motion=motion, reduced=reduced, displacements=(0, 1, 2))
