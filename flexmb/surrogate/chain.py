"""A beam taken apart into a chain of bodies; whatever was attached to the beam moves to the piece at that place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from flexmb.modal import flexible_model
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.schema import BeamBody, Body, Hinge, Scene


class NodePlace(NamedTuple):
    """Where a node of the beam went: number of the piece from the root, its body, and the node's name there."""

    piece: int
    body: str
    node: str


def beams_named(scene: Scene, body: str | None) -> list[BeamBody]:
    """The beam `body` in a list, or all beams if None. ValueError where there is no such beam."""
    beams = [each for each in scene.bodies if isinstance(each, BeamBody) and body in (None, each.name)]
    if body is not None and not beams:
        raise ValueError(_no_beam(scene, body))
    return beams


def inboard_hinge(scene: Scene, beam: BeamBody) -> Hinge:
    """The hinge that joins the beam to its parent."""
    return next(hinge for hinge in scene.hinges if hinge.child == beam.name)


def in_pieces(
    scene: Scene, beam: BeamBody, pieces: Sequence[Body], joints: Sequence[Hinge], places: Mapping[str, NodePlace]
) -> Scene:
    """The scene with `pieces` and the `joints` between them in the place of `beam`.

    `places`, by node of the beam, say where its hinges, wheels, point masses, loads, markers, closures and connectors
    go. The joints follow the beam's inboard hinge. Raises ValueError for a beam with an initial modal state: pieces
    start undeformed.
    """
    if any(state.body == beam.name for state in scene.modal_states):
        raise ValueError(f'beam "{beam.name}": its pieces start undeformed; leave out its modal state')

    def moved(item: Any, body_key: str, node_key: str) -> Any:
        if getattr(item, body_key) != beam.name:
            return item
        place = places[getattr(item, node_key)]
        return replace(item, **{body_key: place.body, node_key: place.node})

    inboard = inboard_hinge(scene, beam)
    hinges: list[Hinge] = []
    for hinge in scene.hinges:
        hinges.append(moved(moved(hinge, "child", "child_node"), "parent", "parent_node"))
        if hinge is inboard:
            hinges += joints
    bodies: list[Body] = []
    for each in scene.bodies:
        bodies += pieces if each is beam else [each]
    closures = tuple(moved(moved(each, "body_a", "node_a"), "body_b", "node_b") for each in scene.closures)
    connectors = tuple(
        moved(moved(each, "body_a", "node_a"), "body_b", "node_b") if isinstance(each, BetweenNodes) else each
        for each in scene.connectors
    )
    on_bodies = {
        key: tuple(moved(item, "body", "node") for item in getattr(scene, key))
        for key in ("wheels", "point_masses", "loads", "markers")
    }
    return replace(
        scene, bodies=tuple(bodies), hinges=tuple(hinges), closures=closures, connectors=connectors, **on_bodies
    )


def piece_at(ends: Sequence[float], x: float) -> int:
    """The piece between two of the `ends` (m, ascending) that holds x; on a cut, the one toward the tip."""
    return min(int(np.searchsorted(ends, x, side="right")) - 1, len(ends) - 2)


def outward(joints: Sequence[Hinge], root: int) -> list[Hinge]:
    """Joints listed along the beam, reordered from the piece `root` outward, so that parents come first."""
    return [*joints[root:], *joints[:root][::-1]]


def stiffness_damping(beam: BeamBody) -> float:
    """Damping over stiffness (s) of every part: 2 zeta/omega of the first mode, whose damping it reproduces."""
    if not np.any(beam.modes.damping_ratio):
        return 0.0
    model = flexible_model(beam)
    return float(model.damping[0, 0] / model.stiffness[0, 0])


def _no_beam(scene: Scene, name: str) -> str:
    """Why `name` cannot be taken apart."""
    found = next((each for each in scene.bodies if each.name == name), None)
    if found is None:
        return f'scene "{scene.name}" has no beam "{name}"'
    kind = type(found).__struct_config__.tag
    return f'body "{name}" is no beam (kind "{kind}"): only a body given by its sections can be taken apart'
