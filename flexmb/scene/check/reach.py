"""How far a scene's bodies reach, by which the rounding of their inertia is measured."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from flexmb.scene.bodies import BeamBody, RigidBody
from flexmb.scene.columns import column
from flexmb.scene.schema import Scene
from flexmb.scene.tree import GROUND
from flexmb.typing import Real


def reach(scene: Scene) -> float:
    """The largest distance (m) from the origin of a body to its mass centre, its nodes and hinges, and along a beam.

    Where bodies are, an orbit for instance, does not count: no inertia is computed from that.
    """
    return max((float(np.max(np.linalg.norm(arm, axis=1), initial=0.0)) for arm in _arms(scene)), default=0.0)


def _arms(scene: Scene) -> Iterator[Real]:
    rigid = [body for body in scene.bodies if isinstance(body, RigidBody)]
    yield column(rigid, "com_m", 3)
    yield column([node for body in rigid for node in body.nodes], "position_m", 3)
    yield np.array([[body.length_m] for body in scene.bodies if isinstance(body, BeamBody)]).reshape(-1, 1)
    yield column(scene.hinges, "child_position_m", 3)
    yield column([hinge for hinge in scene.hinges if hinge.parent != GROUND], "parent_position_m", 3)
