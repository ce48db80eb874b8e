"""The coordinates of a peer's tree by the names that all engines share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, assert_never

from crosscheck.engines.linear.coordinates import coordinate_names, freedom_names, places
from crosscheck.engines.links import Ball, Floating, Scalar
from crosscheck.engines.rigid_tree import AnySlot
from flexmb.scene.schema import Scene
from flexmb.typing import Index


@dataclass(frozen=True)
class SlotPlaces(Generic[AnySlot]):
    """places (n,): where the peer has each of the shared coordinates; its slots of ball joints and of free flights."""

    places: Index
    balls: list[AnySlot]
    flying: list[AnySlot]


def slot_places(scene: Scene, slots: Sequence[AnySlot], speeds: int, *, linear_first: bool) -> SlotPlaces[AnySlot]:
    """Of a peer with so many speeds; `linear_first`: whether its velocities of free flight are [linear; angular]."""
    own, balls, flying = [""] * speeds, list[AnySlot](), list[AnySlot]()
    for slot, names in slot_names(scene, slots):
        match slot.freedom:
            case Scalar():
                pass
            case Ball():
                balls.append(slot)
            case Floating():
                flying.append(slot)
                names = (*names[3:], *names[:3]) if linear_first else names
            case _:
                assert_never(slot.freedom)
        own[slot.v : slot.v + len(names)] = names
    return SlotPlaces(places(coordinate_names(scene), own), balls, flying)


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
