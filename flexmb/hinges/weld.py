"""Weld: no freedom."""

from flexmb.hinges.kind import Item, Reduced, scalar_hinge
from flexmb.jit.kernel import helper
from flexmb.scene.schema import PointMass, Weld


@helper
def pose(q, i, sequence, parameters):
    return (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)


@helper
def motion(q, i, u, j, sequence, parameters, H):
    zero = (0.0, 0.0, 0.0)
    return (zero, zero), (zero, zero)


def reduced(item: Item) -> Reduced | None:
    """Welds, and point masses without a direction."""
    match item:
        case Weld() | PointMass(directions=()):
            return Reduced()
    return None


HINGE = scalar_hinge("weld", 0, pose=pose, motion=motion, reduced=reduced)
