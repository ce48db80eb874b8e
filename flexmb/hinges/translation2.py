"""Two translations along x and y of O+ (a point mass free in a plane)."""

import numpy as np

from flexmb.hinges.kind import Item, Reduced, scalar_hinge
from flexmb.jit.kernel import helper
from flexmb.scene.schema import PointMass


@helper
def pose(q, i, sequence, parameters):
    return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (q[i], q[i + 1], 0.0)


@helper
def motion(q, i, u, j, sequence, parameters, H):
    H[3, 0] = 1.0
    H[4, 1] = 1.0
    zero = (0.0, 0.0, 0.0)
    return (zero, (u[j], u[j + 1], 0.0)), (zero, zero)


def reduced(item: Item) -> Reduced | None:
    """Point masses of two directions, which become x and y."""
    match item:
        case PointMass(directions=(x, y)):
            return Reduced(turn=np.column_stack([x, y, np.cross(x, y)]))
    return None


HINGE = scalar_hinge("translation2", 2, pose=pose, motion=motion, reduced=reduced, displacements=(0, 1))
