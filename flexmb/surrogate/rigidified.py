"""Flexible bodies as rigid ones."""

from __future__ import annotations

from msgspec.structs import replace

from flexmb.scene.schema import Scene, SidBody
from flexmb.surrogate.lumping import rigid_equivalent


def rigidify(scene: Scene) -> Scene:
    """The scene with rigid bodies of the same inertia and nodes in place of flexible ones, without modal states."""
    bodies = tuple(body if isinstance(body, SidBody) else rigid_equivalent(body) for body in scene.bodies)
    return replace(scene, bodies=bodies, modal_states=())
