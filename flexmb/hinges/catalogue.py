"""The list of all hinge kinds, and what follows from it. The number of a kind is its place in the list."""

from __future__ import annotations

import numpy as np

from flexmb.hinges import (
    cylindrical,
    free,
    gimbal2,
    gimbal3,
    planar,
    prismatic,
    revolute,
    spherical,
    translation2,
    translation3,
    weld,
)
from flexmb.hinges.kind import HingeKind, Item, Reduced
from flexmb.jit.kernel import helper
from flexmb.jit.numbered import numbered

KINDS: tuple[HingeKind, ...] = tuple(
    module.HINGE
    for module in (
        weld, revolute, prismatic, cylindrical, gimbal2, gimbal3, spherical, planar, translation2, translation3, free
    )
)  # fmt: skip

pose = numbered("pose", [kind.pose for kind in KINDS])
motion = numbered("motion", [kind.motion for kind in KINDS])
rate = numbered("rate", [kind.rate for kind in KINDS])
retract = numbered("retract", [kind.retract for kind in KINDS])

_QUATERNION = np.array([kind.quaternion for kind in KINDS])


@helper
def quaternion_offset(number):
    """Where the quaternion of a hinge begins among its coordinates; -1 where it has none."""
    return _QUATERNION[number]


def kind_of(item: Item) -> tuple[HingeKind, Reduced]:
    """The kind of a hinge or point mass of a scene, and its axes as the kernels of that kind take them."""
    for kind in KINDS:
        reduced = kind.reduced(item)
        if reduced is not None:
            return kind, reduced
    raise TypeError(f"no kind of flexmb.hinges takes a {type(item).__name__}: {item.name}")
