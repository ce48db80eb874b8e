"""Flexible bodies as rigid ones."""

from __future__ import annotations

from msgspec.structs import replace

from flexmb.scene.schema import Scene, SidBody
from flexmb.surrogate.lumping import rigid_equivalent


def rigidify(scene: Scene) -> Scene:
    """Every flexible body replaced by the rigid body with the same inertia and nodes; modal states are dropped."""
    bodies = tuple(each if isinstance(each, SidBody) else rigid_equivalent(each) for each in scene.bodies)
    return replace(scene, bodies=bodies, modal_states=())
