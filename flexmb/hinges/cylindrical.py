"""Cylindrical: rotation about z and translation along z; q = [angle, displacement]."""

from flexmb.hinges.kind import Item, Reduced, scalar_hinge, z_to
from flexmb.jit.kernel import helper
from flexmb.scene.schema import Cylindrical
from flexmb.spatial.rotation import rotation_z


@helper
def pose(q, i, sequence, parameters):
    return rotation_z(q[i]), (0.0, 0.0, q[i + 1])


@helper
def motion(q, i, u, j, sequence, parameters, H):
    H[2, 0] = 1.0
    H[5, 1] = 1.0
    zero = (0.0, 0.0, 0.0)
    return ((0.0, 0.0, u[j]), (0.0, 0.0, u[j + 1])), (zero, zero)


def reduced(item: Item) -> Reduced | None:
    """Cylindrical hinges."""
    return Reduced(turn=z_to(item.axis)) if isinstance(item, Cylindrical) else None


HINGE = scalar_hinge("cylindrical", 2, pose=pose, motion=motion, reduced=reduced, displacements=(1,))
