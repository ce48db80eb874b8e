"""Planar: translation in the x-y plane of O+, then rotation about z; q = [x, y, angle]."""

from flexmb.hinges.kind import Item, Reduced, scalar_hinge
from flexmb.jit.kernel import helper
from flexmb.scene.schema import Planar
from flexmb.spatial.rotation import rotation_z
from flexmb.spatial.scalar import sincos


@helper
def pose(q, i, sequence, parameters):
    return rotation_z(q[i + 2]), (q[i], q[i + 1], 0.0)


@helper
def motion(q, i, u, j, sequence, parameters, H):
    s, c = sincos(q[i + 2])
    H[3, 0] = c
    H[4, 0] = -s
    H[3, 1] = s
    H[4, 1] = c
    H[2, 2] = 1.0
    # seen from O+ the directions of x and y do not turn: no bias
    zero = (0.0, 0.0, 0.0)
    v = (c * u[j] + s * u[j + 1], -s * u[j] + c * u[j + 1], 0.0)
    return ((0.0, 0.0, u[j + 2]), v), (zero, zero)


def reduced(item: Item) -> Reduced | None:
    """Planar hinges."""
    return Reduced() if isinstance(item, Planar) else None


HINGE = scalar_hinge("planar", 3, pose=pose, motion=motion, reduced=reduced, displacements=(0, 1))
