"""The pieces of a beam of level "exact", each with polynomials of its own, and where its strains have kinks and jumps.

Strains jump at a force or a moment, at a lump, and where the section does. Polynomials across the place converge with a
low power of their number, those of two pieces that meet there as fast as along a smooth beam.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from flexmb.scene.bodies import BeamBody
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.hinges import Closure
from flexmb.scene.schema import Scene
from flexmb.typing import Real

AT_END = 1e-9
"""Distance from the end of a piece, over the beam's length, within which a place is taken to be there."""


def cuts(body: BeamBody) -> tuple[float, ...]:
    """The places (m) inside the beam, ascending, where it is cut; without those that `check_scene` refuses."""
    at = {node.name: node.x_m for node in body.nodes}
    found = sorted({at[name] for name in body.modes.cuts if name in at})
    return tuple(x for x in found if 0.0 < x < body.length_m)


def edges(body: BeamBody) -> Real:
    """The ends (n+1,) m of the n pieces: each part between two cuts is divided into equal ones."""
    ends = (0.0, *cuts(body), body.length_m)
    parts = [np.linspace(left, right, body.modes.pieces + 1) for left, right in pairwise(ends)]
    return np.concatenate([parts[0], *(part[1:] for part in parts[1:])])


def piece_count(body: BeamBody) -> int:
    """Number of pieces of a beam."""
    return (len(cuts(body)) + 1) * body.modes.pieces


def across(scene: Scene, body: BeamBody) -> dict[float, str]:
    """What is inside the pieces of a beam of the scene that makes its strains jump: place (m) and what is there."""
    ends = edges(body)
    found: dict[float, str] = {}
    for x, what in (*_ports(scene, body), *_lumps_and_steps(body)):
        if np.min(np.abs(ends - x)) > AT_END * body.length_m:
            found.setdefault(x, what)
    return dict(sorted(found.items()))


def _ports(scene: Scene, body: BeamBody) -> Iterator[tuple[float, str]]:
    """Nodes of the beam with a hinge, a closure, a connector, a load, a wheel or a point mass."""
    at = {node.name: node.x_m for node in body.nodes}

    def place(item: Any, body_key: str, node_key: str, what: str) -> Iterator[tuple[float, str]]:
        if getattr(item, body_key) == body.name and (node := getattr(item, node_key)) in at:
            yield at[node], f'{what} "{item.name}" at node "{node}"'

    for hinge in scene.hinges:
        yield from place(hinge, "parent", "parent_node", "hinge")
        yield from place(hinge, "child", "child_node", "hinge")
    between = [*scene.closures, *(each for each in scene.connectors if isinstance(each, BetweenNodes))]
    for item in between:
        what = "closure" if isinstance(item, Closure) else "connector"
        yield from place(item, "body_a", "node_a", what)
        yield from place(item, "body_b", "node_b", what)
    for what, on_body in (("load", scene.loads), ("wheel", scene.wheels), ("point mass", scene.point_masses)):
        for each in on_body:
            yield from place(each, "body", "node", what)


def _lumps_and_steps(body: BeamBody) -> Iterator[tuple[float, str]]:
    """Lumps of the beam, and places where two stations differ."""
    for i, lump in enumerate(body.tip_masses):
        yield lump.x_m, f"tip_masses[{i}]"
    stations = sorted(body.stations, key=lambda station: station.x_m)
    for left, right in pairwise(stations):
        if left.x_m == right.x_m and left != right and 0.0 < left.x_m < body.length_m:
            yield left.x_m, "a step of the section"
