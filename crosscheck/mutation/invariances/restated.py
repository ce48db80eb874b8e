"""The same scene in other words: everything declared in the opposite order, since references are by name; and sections
of beams stated at another reference point, as matrices.

Results that change with the latter depend on where the section's axis was drawn, as they do when the transport of
stiffness or inertia leaves out a coupling of extension, bending and torsion. Each station is stated at a point of its
own.
"""

from __future__ import annotations

from math import sqrt

import msgspec
from msgspec.structs import replace

from crosscheck.mutation.invariances.counterpart import Counterpart, Invariance, NotApplicable
from crosscheck.mutation.invariances.linearised import relation
from flexmb.scene.bodies import BeamBody, BeamStation, Body
from flexmb.scene.schema import Scene
from flexmb.scene.sections import restated, stiffness_on_axis

STEPS = ((1.25, -0.75), (-0.5, 1.5), (0.75, 1.0))  # in radii of gyration, which lose no digits; one after the other


def _restated(scene: Scene) -> Counterpart:
    if not any(isinstance(body, BeamBody) for body in scene.bodies):
        raise NotApplicable("no body of the scene is a beam, whose sections have a reference point")
    return Counterpart(replace(scene, bodies=tuple(map(_elsewhere, scene.bodies))), lambda times, channels: channels)


def _elsewhere(body: Body) -> Body:
    if not isinstance(body, BeamBody):
        return body
    stations = tuple(_beside(station, STEPS[i % len(STEPS)]) for i, station in enumerate(body.stations))
    return replace(body, stations=stations)


def _beside(station: BeamStation, step: tuple[float, float]) -> BeamStation:
    K, (y, z) = stiffness_on_axis(station), station.reference_point_m
    gyration = sqrt(min(K[3:, 3:].diagonal()) / K[0, 0])
    return restated(station, (y + step[0] * gyration, z + step[1] * gyration))


RESTATED = Invariance("restated", "sections of beams stated at another reference point", _restated)


COLLECTIONS = (
    "bodies", "hinges", "closures", "couplings", "connectors", "wheels", "point_masses", "loads", "markers",
    "total_loads", "modal_states",
)  # fmt: skip


def _reordered(scene: Scene) -> Counterpart:
    changes = {name: getattr(scene, name)[::-1] for name in COLLECTIONS}
    if all(len(items) < 2 for items in changes.values()):
        raise NotApplicable("there is one of each thing only")
    other = msgspec.structs.replace(scene, **changes)
    return Counterpart(other, lambda times, channels: channels, linear=relation(scene, other))


REORDERED = Invariance("reordered", "bodies, hinges and all else declared in the opposite order", _reordered)
