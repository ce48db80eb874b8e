"""An effort is a step and a mesh: both errors are of second order, and both are halved by the next one."""

from __future__ import annotations

from msgspec.structs import replace

from crosscheck.engines.beam_elements import first_bending
from crosscheck.engines.contract import Effort
from crosscheck.engines.pace import pace
from crosscheck.engines.steps import ladder
from flexmb.scene.schema import BeamBody, Scene

RUNGS, USUAL = 3, 800
"""Of steps, and how many are worth their time at the coarsest: the beam's bending is followed, its axial vibrations
are stepped over and damped."""
METHOD = "BDF2"


def steps_and_meshes(scene: Scene, duration_s: float) -> tuple[Effort, ...]:
    """Three steps, each half the one before: with half the scene's number of elements, with it, and with twice it."""
    return ladder(METHOD, pace(scene, duration_s, first_bending(_beam(scene))), duration_s, RUNGS, USUAL)


def meshed(scene: Scene, duration_s: float, effort: Effort) -> Scene:
    """The scene with as many elements as belong to an effort: their length is in proportion to its step."""
    beam = _beam(scene)
    coarsest = steps_and_meshes(scene, duration_s)[0].value
    count = max(1, round(beam.elements * coarsest / effort.value / 2.0))
    return replace(scene, bodies=(replace(beam, elements=count),))


def _beam(scene: Scene) -> BeamBody:
    beam = scene.bodies[0]
    assert isinstance(beam, BeamBody)
    return beam
