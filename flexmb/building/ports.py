"""Ports of a scene: every frame on a body at which something is attached, numbered body by body."""

from __future__ import annotations

from itertools import accumulate
from typing import NamedTuple

import numpy as np

from flexmb.building.connector_arrays import end_ports
from flexmb.building.links import BodyLink, Port, port, sides_of_closures
from flexmb.building.models import ORIGIN
from flexmb.building.rigid_arrays import Frames, inboard_frames, outboard_frames
from flexmb.kept import kept
from flexmb.scene import schema as s
from flexmb.scene.bodies import IDENTITY, ZERO
from flexmb.scene.tree import GROUND

Place = tuple[int, int] | None
"""(body, number among the ports of the body); None on the ground, and where no port is needed."""


class _Ports:
    """The ports of each body, and their numbers once all have been added."""

    def __init__(self, chain: list[BodyLink]) -> None:
        self.by_body: list[list[Port]] = [[] for _ in chain]

    def add(self, body: int, at: Port) -> tuple[int, int]:
        """Add a port to a body; returns its place."""
        self.by_body[body].append(at)
        return body, len(self.by_body[body]) - 1

    def on_body(self, place: Place) -> tuple[int, int]:
        """Body of a place, and number of its port among all; (-1, -1) for None. All ports must have been added."""
        if place is None:
            return -1, -1
        body, i = place
        return body, self._first[body] + i

    @kept
    def _first(self) -> list[int]:
        """For each body, the number of ports of the bodies before it."""
        return list(accumulate((len(ports) for ports in self.by_body), initial=0))


class Attached(NamedTuple):
    """Numbers of the ports of hinges, wheels and loads, -1 for none; (body, port) of markers, and of sides A and B of
    each closure and connector, (-1, -1) on the ground."""

    inboard: list[int]
    outboard: list[int]
    wheels: list[int]
    loads: list[int]
    markers: dict[str, tuple[int, int]]
    closures: list[tuple[int, int]]
    connectors: list[tuple[int, int]]


def attached(
    scene: s.Scene, chain: list[BodyLink], index: dict[str, int], hinges: list[Port | None],
    wheels: list[s.Wheel], loads: list[s.Load], like: s.Scene | None = None,
) -> tuple[list[list[Port]], Attached]:  # fmt: skip
    """The ports of all bodies, and what is attached to them. `like`: see `flexmb.building.links.links`.

    index: number of a body by its name; hinges: for each link the port of its inboard hinge frame, if it needs one.
    """
    ports = _Ports(chain)

    def at_node(item: s.Wheel | s.Load | s.Marker) -> Place:
        k = index[item.body]
        node = chain[k].node(item.node)
        return ports.add(k, port(node, getattr(item, "offset_m", ZERO), IDENTITY, np.eye(3)))

    inboard = [
        None if at is None else ports.add(index[link.parent], at) for link, at in zip(chain, hinges, strict=True)
    ]
    outboard = [
        ports.add(k, link.outboard) if not link.is_rigid and link.outboard.deforms else None
        for k, link in enumerate(chain)
    ]
    at_wheels, at_loads = [at_node(wheel) for wheel in wheels], [at_node(load) for load in loads]
    markers = {marker.name: at_node(marker) for marker in scene.markers}
    sides = [
        None if side.body == GROUND else ports.add(index[side.body], side.port(chain[index[side.body]]))
        for _, both in sides_of_closures(scene, like)
        for side in both
    ]
    ends = [None if end is None else ports.add(*end) for end in end_ports(scene, chain, index)]
    numbered = ([ports.on_body(at)[1] for at in places] for places in (inboard, outboard, at_wheels, at_loads))
    return ports.by_body, Attached(
        *numbered,
        markers={name: ports.on_body(at) for name, at in markers.items()},
        closures=[ports.on_body(at) for at in sides],
        connectors=[ports.on_body(at) for at in ends],
    )


def inboard_frames_and_ports(
    chain: list[BodyLink], parent: list[int], null_partitions: bool
) -> tuple[Frames, list[Port | None]]:
    """Inboard hinge frames in the frames of their parents' links, and those that deformation moves as ports.

    With `null_partitions` those of all hinges on bodies are ports.
    """
    placement, flexible = _on_rigid_bodies(chain, parent), _on_flexible_bodies(chain, parent)
    for k, at in flexible.items():
        placement.p[k], placement.R[k] = at.origin, at.frame
    if null_partitions:
        held = {k: Port(ORIGIN, placement.p[k], placement.R[k]) for k, p in enumerate(parent) if p >= 0}
        return placement, [(held | flexible).get(k) for k in range(len(chain))]
    return placement, [flexible[k] if k in flexible and flexible[k].deforms else None for k in range(len(chain))]


def _on_rigid_bodies(chain: list[BodyLink], parent: list[int]) -> Frames:
    """Inboard hinge frames in the frames of their parents' links, where the parent is rigid or the ground."""
    placement = Frames(np.zeros((len(chain), 3, 3)), np.zeros((len(chain), 3)))
    placed = [k for k, p in enumerate(parent) if p < 0 or chain[p].is_rigid]
    inboard = inboard_frames([chain[k] for k in placed])
    rigid = [k for k, link in enumerate(chain) if link.is_rigid]
    outboard = outboard_frames([chain[k] for k in rigid])
    base = Frames(np.tile(np.eye(3), (len(chain) + 1, 1, 1)), np.zeros((len(chain) + 1, 3)))  # the last is the ground's
    base.R[rigid], base.p[rigid] = outboard
    on = [parent[k] for k in placed]
    placement.R[placed], placement.p[placed] = inboard.seen_from(Frames(base.R[on], base.p[on]))
    return placement


def _on_flexible_bodies(chain: list[BodyLink], parent: list[int]) -> dict[int, Port]:
    """Inboard hinge frames in the frames of their parents' links, by number of the link, for flexible parents."""
    return {
        k: _moved(link.inboard, chain[p])
        for k, (link, p) in enumerate(zip(chain, parent, strict=True))
        if p >= 0 and not chain[p].is_rigid
    }


def _moved(inboard: Port, parent: BodyLink) -> Port:
    """An inboard port in its parent's link frame (the parent may have been referred to its own hinge frame)."""
    if parent.outboard.deforms:
        return inboard
    back, origin = parent.outboard.frame.T, parent.outboard.origin
    return Port(inboard.node.seen_from(origin, back), back @ inboard.offset, back @ inboard.frame)
