"""Screw: rotation about z, and `parameters[0]` (m/rad) times as much translation along it."""

from flexmb.hinges.kind import Item, Reduced, scalar_hinge, z_to
from flexmb.jit.kernel import helper
from flexmb.scene.schema import Screw
from flexmb.spatial.rotation import rotation_z


@helper
def pose(q, i, sequence, parameters):
    return rotation_z(q[i]), (0.0, 0.0, parameters[0] * q[i])


@helper
def motion(q, i, u, j, sequence, parameters, H):
    H[2, 0] = 1.0
    H[5, 0] = parameters[0]
    zero = (0.0, 0.0, 0.0)
    return ((0.0, 0.0, u[j]), (0.0, 0.0, parameters[0] * u[j])), (zero, zero)


def reduced(item: Item) -> Reduced | None:
    """Screws."""
    return Reduced(turn=z_to(item.axis), parameters=(item.pitch_m_rad,)) if isinstance(item, Screw) else None


HINGE = scalar_hinge("screw", 1, pose=pose, motion=motion, reduced=reduced)
