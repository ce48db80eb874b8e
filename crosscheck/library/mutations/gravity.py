"""Mutations of gravity."""

from __future__ import annotations

from msgspec.structs import replace

from crosscheck.library.mutations.edits import opposite, scaled, whole
from crosscheck.library.mutations.mutation import Mutation
from flexmb.scene.schema import Scene

STANDARD_TO_ROUNDED = 9.80665 / 9.81


def _sign(scene: Scene, target: str) -> Scene:
    return replace(scene, gravity_m_s2=opposite(scene.gravity_m_s2))


def _size(scene: Scene, target: str) -> Scene:
    return replace(scene, gravity_m_s2=scaled(scene.gravity_m_s2, STANDARD_TO_ROUNDED))


def _axis(scene: Scene, target: str) -> Scene:
    x, y, z = scene.gravity_m_s2
    return replace(scene, gravity_m_s2=(x, z, y))


def _dropped(scene: Scene, target: str) -> Scene:
    return replace(scene, gravity_m_s2=(0.0, 0.0, 0.0))


MUTATIONS = (
    Mutation("gravity_sign", "opposite gravity", "acceleration of the frame taken for that of the fall", whole, _sign),
    Mutation("gravity_size", "gravity times 9.80665/9.81", "another value of g", whole, _size),
    Mutation(
        "gravity_axis", "y and z of gravity exchanged", "the vertical is y in one code and z in another", whole, _axis
    ),
    Mutation("gravity_dropped", "no gravity", "a switch that is off by default", whole, _dropped),
)
