"""The scene of an animation: with markers on every body, and additional ones along beams.

The markers of a case are those that it judges, and many bodies have none. So its animation has a run of its own, which
is never judged; a view of a trajectory finds the poses of the additional markers at its states instead.
"""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np

from flexmb.interchange.sid.blocks import SidError
from flexmb.interchange.sid.to_body import with_sid_bodies
from flexmb.scene.bodies import BeamBody, BeamNode, Body, RigidBody
from flexmb.scene.hinges import LinearCoordinate, Prismatic
from flexmb.scene.schema import Marker, Scene
from flexmb.scene.tree import coordinates, rest_frames
from flexmb.view.draw import draw
from flexmb.view.drawing import Drawing

PIECES, PIECES_OF_EXACT = 6, 12  # into which additional nodes divide a beam, and one that may bend to circles
ADDED = "drawn"
NO_INERTIA = ((0.0,) * 3,) * 3


def film(scene: Scene) -> tuple[Scene, Drawing] | None:
    """The scene to run and its drawing; None if the scene's own markers suffice or a SID file cannot be read."""
    try:
        filmed = hung(with_sid_bodies(scene))
    except (SidError, OSError):  # the case's runs report the error
        return None
    carried = {marker.body for marker in scene.markers}
    if filmed is scene and all(isinstance(body, RigidBody) and body.name in carried for body in scene.bodies):
        return None
    filmed = marked(filmed)
    return filmed, draw(filmed, trails=[marker.name for marker in scene.markers])


def marked(scene: Scene) -> Scene:
    """The scene with markers on all nodes that are drawn, those that are added along beams included."""
    for body in scene.bodies:
        scene = _with_markers(scene, body)
    return scene


def film_channels(drawing: Drawing) -> tuple[str, ...]:
    carriers = {point.marker for line in drawing.lines for point in line.points if point.marker}
    channels = [
        f"marker:{name}.{part}"
        for name in dict.fromkeys((*sorted(carriers), *drawing.trails, *(wheel.marker for wheel in drawing.wheels)))
        for part in ("position", "orientation")
    ]
    for wheel in drawing.wheels:
        channels += [f"marker:{wheel.marker}.angular_velocity", f"wheel_load:{wheel.name}.torque"]
    return tuple(dict.fromkeys(channels))


def hung(scene: Scene) -> Scene:
    """The scene with moving point masses replaced by bodies on slides, to which markers can be fixed, unless a
    connector, sensor or event refers to them."""
    watching = msgspec.json.encode((scene.connectors, scene.sensors, scene.events)).decode()
    moving = [mass for mass in scene.point_masses if mass.directions and f'"{mass.name}' not in watching]
    if not moving:
        return scene
    bodies, hinges = list(scene.bodies), list(scene.hinges)
    for mass in moving:
        place: dict[str, Any] = {"parent": mass.body, "parent_node": mass.node, "parent_position_m": mass.offset_m}
        for number, (axis, named) in enumerate(zip(mass.directions, coordinates(mass), strict=True), start=1):
            assert isinstance(named.coordinate, LinearCoordinate)
            last = number == len(mass.directions)
            own = mass.name if last else f"{mass.name} {ADDED} {number}"
            bodies.append(RigidBody(name=own, mass_kg=mass.mass_kg if last else 0.0, inertia_kg_m2=NO_INERTIA))
            slide = f"{mass.name} {ADDED} {number}"
            hinges.append(Prismatic(name=slide, child=own, axis=axis, translation=named.coordinate, **place))
            place = {"parent": own}
    kept = tuple(mass for mass in scene.point_masses if mass not in moving)
    return msgspec.structs.replace(scene, bodies=tuple(bodies), hinges=tuple(hinges), point_masses=kept)


def _with_markers(scene: Scene, body: Body) -> Scene:
    """The scene with a marker on every node of the body that is drawn."""
    if isinstance(body, BeamBody):
        pieces = PIECES_OF_EXACT if body.level == "exact" else PIECES
        inside = np.linspace(0.0, body.length_m, pieces + 1)[1:-1]
        added = tuple(BeamNode(name=f"{ADDED} {i}", x_m=float(x)) for i, x in enumerate(inside, start=1))
        longer = msgspec.structs.replace(body, nodes=(*body.nodes, *added))
        bodies = tuple(longer if candidate.name == body.name else candidate for candidate in scene.bodies)
        scene, body = msgspec.structs.replace(scene, bodies=bodies), longer
    nodes = list(rest_frames(body))
    seen = {(marker.body, marker.node) for marker in scene.markers}
    if isinstance(body, RigidBody):
        nodes = [] if any(name == body.name for name, _ in seen) else ["origin"]
    markers = tuple(
        Marker(name=f"{body.name} {node} {ADDED}", body=body.name, node=node)
        for node in nodes
        if (body.name, node) not in seen
    )
    return msgspec.structs.replace(scene, markers=scene.markers + markers)
