"""Scenes for Frisch's route: random trees at level linear, and those his print covers."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

import flexmb
from flexmb.frisch.nested_system import NestedSystem, Partitions
from flexmb.scene import schema as s
from tests import trees

# first-order mass matrices lose definiteness where the deformation is not small
SMALL = replace(trees.LINEAR, deformation=0.03)
CLAMPED = replace(SMALL, carriers=("rigid", "modal", "beam"))


def random_scene(seed: int, recipe: trees.Recipe = SMALL) -> s.Scene:
    return trees.random_scene(seed, recipe)


def clamped(scene: s.Scene) -> s.Scene:
    """The same with every body held at its origin, as the paper wants it: its modes vanish at its inboard hinge."""
    roots = {body.name: "root" if isinstance(body, s.BeamBody) else "origin" for body in scene.bodies}
    hinges = tuple(msgspec.structs.replace(hinge, child_node=roots[hinge.child]) for hinge in scene.hinges)
    return msgspec.structs.replace(scene, hinges=hinges)


def at_level(scene: s.Scene, level: s.Level) -> s.Scene:
    """The same with every flexible body at `level`."""
    bodies = tuple(
        body if isinstance(body, s.RigidBody) else msgspec.structs.replace(body, level=level) for body in scene.bodies
    )
    return msgspec.structs.replace(scene, bodies=bodies)


def packed(state: flexmb.State) -> np.ndarray:
    """y = [q, u, work]."""
    return np.concatenate([state.q, state.u, [0.0]])


def reduced(nested: NestedSystem, state: flexmb.State) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and right side of the scalar equations."""
    return nested.reduced(state.t, packed(state))


def expanded(rows: Partitions, accelerations: np.ndarray) -> np.ndarray:
    """Expanded accelerations in the order of `rows`: S udot plus what is left at udot = 0."""
    return rows.S @ accelerations + rows.bias
