"""Replacement of a beam by a chain of bodies; whatever is attached to the beam is attached to the piece there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from flexmb.modal import flexible_model
from flexmb.scene.connectors import BetweenNodes
from flexmb.scene.schema import BeamBody, Body, Hinge, Scene


class NodePlace(NamedTuple):
    """The new place of a node of the beam: number of the piece from the root, its body, and the node's name there."""

    piece: int
    body: str
    node: str


def beams_named(scene: Scene, body: str | None) -> list[BeamBody]:
    """The beam `body` in a list, or all beams if None. ValueError if there is no such beam."""
    beams = [
        candidate for candidate in scene.bodies if isinstance(candidate, BeamBody) and body in (None, candidate.name)
    ]
    if body is not None and not beams:
        raise ValueError(_no_beam(scene, body))
    return beams


def inboard_hinge(scene: Scene, beam: BeamBody) -> Hinge:
    """The hinge between the beam and its parent."""
    return next(hinge for hinge in scene.hinges if hinge.child == beam.name)


def in_pieces(
    scene: Scene, beam: BeamBody, pieces: Sequence[Body], joints: Sequence[Hinge], places: Mapping[str, NodePlace]
) -> Scene:
    """The scene with `pieces` and the `joints` between them in place of `beam`.

    `places` maps nodes of the beam to the new places of its hinges, wheels, point masses, loads, markers, closures and
    connectors. The joints follow the beam's inboard hinge. Raises ValueError for a beam with an initial modal state,
    because the pieces start undeformed, and for one on which loads are totalled.
    """
    if any(state.body == beam.name for state in scene.modal_states):
        raise ValueError(f'beam "{beam.name}": its pieces start undeformed; leave out its modal state')

    if total := next((total for total in scene.total_loads if total.body == beam.name), None):
        raise ValueError(f'beam "{beam.name}": its joints hold several pieces; leave out the total load "{total.name}"')

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
    for body in scene.bodies:
        bodies += pieces if body is beam else [body]
    closures = tuple(moved(moved(closure, "body_a", "node_a"), "body_b", "node_b") for closure in scene.closures)
    connectors = tuple(
        moved(moved(connector, "body_a", "node_a"), "body_b", "node_b")
        if isinstance(connector, BetweenNodes)
        else connector
        for connector in scene.connectors
    )
    on_bodies = {
        key: tuple(moved(item, "body", "node") for item in getattr(scene, key))
        for key in ("wheels", "point_masses", "loads", "markers")
    }
    return replace(
        scene, bodies=tuple(bodies), hinges=tuple(hinges), closures=closures, connectors=connectors, **on_bodies
    )


def piece_at(ends: Sequence[float], x: float) -> int:
    """The number of the piece between two of the `ends` (m, ascending) that contains x; at a cut the outer one."""
    return min(int(np.searchsorted(ends, x, side="right")) - 1, len(ends) - 2)


def outward(joints: Sequence[Hinge], root: int) -> list[Hinge]:
    """Joints listed along the beam, reordered from the piece `root` outward, so that parents come first."""
    return [*joints[root:], *joints[:root][::-1]]


def stiffness_damping(beam: BeamBody) -> float:
    """Ratio (s) of damping and stiffness of all parts: the viscosity and 2 zeta/omega of the first mode, whose damping
    is thus exact."""
    if not np.any(beam.modes.damping_ratio):
        return beam.modes.viscosity_s
    model = flexible_model(beam)
    return float(model.damping[0, 0] / model.stiffness[0, 0])


def _no_beam(scene: Scene, name: str) -> str:
    """The message that `name` is not a beam."""
    found = next((body for body in scene.bodies if body.name == name), None)
    if found is None:
        return f'scene "{scene.name}" has no beam "{name}"'
    kind = type(found).__struct_config__.tag
    return f'body "{name}" is not a beam (kind "{kind}"): only beams, given by their sections, can be divided'
