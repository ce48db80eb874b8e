"""Scenes with beams of finite deflection in space: what is refused, and how fast their beams bend."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from crosscheck.engines.beam_elements import first_bending, shears
from crosscheck.engines.exudyn.assembly import bends
from crosscheck.engines.exudyn.support import refusals
from flexmb.scene.schema import BeamBody, Scene
from flexmb.scene.sections import inertia_on_axis, stiffness_on_axis
from flexmb.scene.strains import strain_count

AXIAL = 3  # row and column of the inertia about the axis


def spatial_refusals(scene: Scene) -> Iterator[str]:
    """Why Exudyn cannot run a scene with its beams as elements in space."""
    beams = bending(scene)
    if not beams:
        yield "it takes scenes with a beam that is not rigid"
        return
    if scene.modal_states:
        yield "initial modal coordinates have no meaning here: begin at rest, and load the beam"
    yield from refusals(scene, tuple(body for body in scene.bodies if body not in beams))
    for beam in beams:
        yield from _beam_refusals(beam)


def bending(scene: Scene) -> tuple[BeamBody, ...]:
    """The beams that are made of elements."""
    return tuple(body for body in scene.bodies if bends(body))


def reason(scene: Scene) -> str:
    """What is another model in it than the scene's."""
    words = "beams of finite deflection, stretch and twist instead of modes"
    stiff = [beam.name for beam in bending(scene) if not shears(beam)]
    return f'{words}; {", ".join(stiff)}: shear as stiff as stretch' if stiff else words


def fastest_bending(scene: Scene) -> float:
    """Highest of the first frequencies (rad/s) of all beams, free and in their stiffer plane, by their first
    station."""
    return max(map(first_bending, bending(scene)))


def _beam_refusals(beam: BeamBody) -> Iterator[str]:
    who = f'beam "{beam.name}"'
    if np.any(beam.modes.damping_ratio) or beam.modes.viscosity_s:
        yield f"{who}: the elements have no modal damping, and none by the rate of strain"
    if beam.level == "exact" and not strain_count(beam):
        yield f'{who} has no strains: make it level "rigid"'
    if beam.points == "line":
        yield f'{who}: its sections have no rotary inertia, with which the elements twist: use points = "section"'
    try:
        stiffness = [stiffness_on_axis(station) for station in beam.stations]
        inertia = [inertia_on_axis(station) for station in beam.stations]
    except ValueError as error:
        yield f"{who}: {error}"
        return
    for station, K, M in zip(beam.stations, stiffness, inertia, strict=True):
        at = f"{who}, station at x = {station.x_m:g} m"
        if np.any(K - np.diag(np.diag(K))):
            yield (
                f"{at}: the elements have a diagonal stiffness, and this one couples strains on the axis; compare with "
                'engine "exudyn" after the beam is made points and modes'
            )
        if M[AXIAL, AXIAL] <= 0.0 or np.any(np.diag(M)[AXIAL + 1 :] <= 0.0):
            yield f"{at}: the sections turn, and need rotary inertia: give rotary_y_kg_m and rotary_z_kg_m"
        if shears(beam) and station.stiffness is None and (station.GAy_N is None or station.GAz_N is None):
            yield f"{at}: a shear-flexible beam in space needs GAy_N and GAz_N"
