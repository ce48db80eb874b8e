"""Loads at nodes of a DART tree."""

from __future__ import annotations

import dartpy

from crosscheck.engines.conventions import cross
from crosscheck.engines.dart.tree import DartTree
from crosscheck.engines.rigid_tree import PointLoad, placed_loads
from flexmb.scene.schema import Scene


class DartLoads:
    """Loads at nodes, put on the bodies of a tree that is in the state of the time asked for."""

    def __init__(self, tree: DartTree, scene: Scene) -> None:
        self._skeleton = tree.skeleton
        self._loads = [_DartLoad(tree.bodies[link], load) for link, load in placed_loads(scene, tree.links)]

    def __bool__(self) -> bool:
        return bool(self._loads)

    def apply(self, t: float) -> float:
        """Replace what acts on the bodies; returns the power (W)."""
        self._skeleton.clearExternalForces()
        return sum(load.apply(t) for load in self._loads)


class _DartLoad:
    def __init__(self, body: dartpy.dynamics.BodyNode, load: PointLoad) -> None:
        self._body, self._load = body, load

    def apply(self, t: float) -> float:
        R = self._body.getWorldTransform().rotation()
        vector, point = self._load.in_world(t, R), self._load.point
        turning = self._body.getAngularVelocity()
        if not self._load.is_force:
            self._body.addExtTorque(vector, False)
            return float(vector @ turning)
        self._body.addExtForce(vector, point, False, True)
        return float(vector @ (self._body.getLinearVelocity() + cross(turning, R @ point)))
