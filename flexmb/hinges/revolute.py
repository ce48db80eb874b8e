"""Revolute: one rotation about z."""

from flexmb.hinges.kind import Item, Reduced, scalar_hinge, z_to
from flexmb.jit.kernel import helper
from flexmb.scene.schema import Revolute
from flexmb.spatial.rotation import rotation_z
from flexmb.tables.arrays import ANGULAR_Z


@helper
def pose(q, i, sequence, parameters):
    return rotation_z(q[i]), (0.0, 0.0, 0.0)


@helper
def motion(q, i, u, j, sequence, parameters, H):
    H[2, 0] = 1.0
    zero = (0.0, 0.0, 0.0)
    return ((0.0, 0.0, u[j]), zero), (zero, zero)


def reduced(item: Item) -> Reduced | None:
    """Revolute hinges."""
    return Reduced(turn=z_to(item.axis)) if isinstance(item, Revolute) else None


HINGE = scalar_hinge("revolute", 1, pose=pose, motion=motion, reduced=reduced, axis=ANGULAR_Z)
