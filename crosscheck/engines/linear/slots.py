"""The coordinates of a peer's tree by the names that all engines share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from crosscheck.engines.linear.coordinates import freedom_names
from crosscheck.engines.rigid_tree import AnySlot
from flexmb.scene.schema import Scene


def slot_names(scene: Scene, slots: Sequence[AnySlot]) -> Iterator[tuple[AnySlot, tuple[str, ...]]]:
    """Every slot of a freedom of the scene with the names of its displacements, none if it is driven.

    A slot that stands for a weld is none of the scene's and has no names either.
    """
    items = {item.name: freedom_names(item) for item in (*scene.hinges, *scene.point_masses, *scene.wheels)}
    before: Counter[str] = Counter()
    for slot in slots:
        names = items[slot.link.joint]
        k = before[slot.link.joint]
        before[slot.link.joint] += 1
        yield slot, names[k] if k < len(names) else ()
