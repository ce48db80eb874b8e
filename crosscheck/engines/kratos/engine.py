"""The Kratos adapter: what it takes, and how hard it may try."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from crosscheck.engines.contract import Effort, Model
from crosscheck.engines.kratos import library
from crosscheck.engines.kratos.efforts import steps_and_meshes
from crosscheck.engines.peer import PeerEngine
from flexmb.scene.freedoms import ScalarFreedom
from flexmb.scene.hinges import AngularCoordinate, Hinge, LinearCoordinate, Planar, Revolute, Weld
from flexmb.scene.schema import BeamBody, Scene
from flexmb.scene.sections import inertia_on_axis, stiffness_on_axis
from flexmb.scene.strains import strain_count
from flexmb.scene.tree import GROUND

REASON = (
    "corotational beam elements of finite deflection, stretch and twist instead of modes, without the gyroscopic "
    "moments of sections"
)


class KratosEngine(PeerEngine):
    """One beam on the ground, by Kratos' corotational elements and its own implicit time integration."""

    name = "kratos"
    summary = "a beam of finite deflection, by corotational elements"
    algorithm = "corotational finite elements, implicit steps"
    settings = (
        "Kratos' own Newton iteration and its scheme of backward differences of second order, with fixed steps that "
        "follow the bending. An effort is a step and a mesh: half the scene's number of elements at the coarsest, "
        "twice it at the finest. The loop over steps is in Python, all in a step is compiled, on one thread. The timed "
        "solve contains the reading of samples."
    )

    def version(self) -> str:
        """Version of the library; raises EngineMissing where it is not installed."""
        return library.version()

    def refusals(self, scene: Scene) -> Iterator[str]:
        return _refusals(scene)

    def approximations(self, scene: Scene) -> Iterator[str]:
        """All scenes: it is another model of the beam than its modes, and a richer one."""
        yield REASON

    def efforts_for(self, scene: Scene, duration_s: float) -> tuple[Effort, ...]:
        """Three steps, each half the one before, with elements of half the length too."""
        return steps_and_meshes(scene, duration_s)

    def model(self, scene: Scene) -> Model:
        from crosscheck.engines.kratos.model import KratosModel

        return KratosModel(scene)


def _refusals(scene: Scene) -> Iterator[str]:
    """Why the scene is not one of a beam on the ground."""
    if len(scene.bodies) != 1 or not isinstance(scene.bodies[0], BeamBody):
        yield "it takes scenes with one beam and nothing else: compare trees and loops of beams with exudyn-beam"
        return
    beam, hinge = scene.bodies[0], scene.hinges[0]
    for item in (*scene.closures, *scene.couplings, *scene.wheels, *scene.point_masses, *scene.connectors):
        yield f'"{item.name}": it takes a bare beam, without closures, couplings, wheels, point masses and connectors'
    if beam.tip_masses:
        yield f'beam "{beam.name}" has lumped masses, and the adapter gives the elements none: use exudyn-beam'
    if scene.modal_states:
        yield "initial modal coordinates have no meaning here: begin at rest, and load the beam"
    for load in scene.loads:
        if load.frame != "world":
            yield f'load "{load.name}" turns with its node: Kratos\' point loads keep their World axes'
    yield from _beam_refusals(beam)
    yield from _hinge_refusals(hinge)


def _beam_refusals(beam: BeamBody) -> Iterator[str]:
    who = f'beam "{beam.name}"'
    if beam.level == "rigid":
        yield f"{who} is rigid in this scene"
    if beam.level == "exact" and not strain_count(beam):
        yield f"{who} has no strains"
    if np.any(beam.modes.damping_ratio) or beam.modes.viscosity_s:
        yield f"{who}: the elements have no modal damping, and none by the rate of strain"
    for station in beam.stations:
        at = f"{who}, station at x = {station.x_m:g} m"
        try:
            K, M = stiffness_on_axis(station), inertia_on_axis(station)
        except ValueError as error:
            yield f"{who}: {error}"
            return
        if any(np.any(each - np.diag(np.diag(each))) for each in (K, M)):
            yield (
                f"{at}: the elements have the diagonals of stiffness and inertia, and these couple strains on the "
                'axis: compare with engine "exudyn" after the beam is made points and modes'
            )
        if beam.theory == "timoshenko" and station.stiffness is None and None in (station.GAy_N, station.GAz_N):
            yield f"{at}: a shear-flexible beam in space needs GAy_N and GAz_N"


def _hinge_refusals(hinge: Hinge) -> Iterator[str]:
    if hinge.parent != GROUND or not isinstance(hinge, Weld | Revolute | Planar):
        yield "the beam must be welded to the ground or hinged to it (revolute, planar)"
        return
    if any(hinge.child_position_m):
        yield "the hinge must be on the axis of the beam, at one of its nodes"
    for freedom in hinge.freedoms:
        given = ("prescribed_rad",) if isinstance(hinge, Revolute) else ()
        assert isinstance(freedom, ScalarFreedom)
        if not _bare(freedom.coordinate, *given):
            yield "the hinge moves freely, and a revolute one as prescribed: it has no spring, damper or motor here"


def _bare(coordinate: AngularCoordinate | LinearCoordinate, *given: str) -> bool:
    """Whether nothing but its initial value and rate, or the keys `given`, is set."""
    keys = set(coordinate.__struct_fields__) - {"angle_rad", "rate_rad_s", "position_m", "rate_m_s", *given}
    return all(getattr(coordinate, key) == getattr(type(coordinate)(), key) for key in keys)
