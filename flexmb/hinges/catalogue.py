"""The list of all hinge kinds, and what follows from it. The number of a kind is its place in the list."""

from __future__ import annotations

from flexmb.hinges import (
    cylindrical,
    free,
    gimbal2,
    gimbal3,
    planar,
    prismatic,
    revolute,
    screw,
    spherical,
    translation2,
    translation3,
    weld,
)
from flexmb.hinges.kind import HingeKind, Item, Reduced
from flexmb.jit.numbered import numbered
from flexmb.tables.features import HINGE

KINDS: tuple[HingeKind, ...] = tuple(
    module.HINGE
    for module in (
        weld, revolute, prismatic, cylindrical, gimbal2, gimbal3, spherical, planar, translation2, translation3, free,
        screw,
    )
)  # fmt: skip

pose = numbered("pose", HINGE, [kind.pose for kind in KINDS])
motion = numbered("motion", HINGE, [kind.motion for kind in KINDS])
rate = numbered("rate", HINGE, [kind.rate for kind in KINDS])
retract = numbered("retract", HINGE, [kind.retract for kind in KINDS])
resolve = numbered("resolve", HINGE, [kind.resolve for kind in KINDS])

def kind_of(item: Item) -> tuple[HingeKind, Reduced]:
    """The kind of a hinge or point mass of a scene, and its axes as the kernels of that kind take them."""
    for kind in KINDS:
        reduced = kind.reduced(item)
        if reduced is not None:
            return kind, reduced
    raise TypeError(f"no kind of flexmb.hinges takes a {type(item).__name__}: {item.name}")
