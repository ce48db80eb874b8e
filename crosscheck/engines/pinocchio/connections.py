"""Connectors on a Pinocchio tree: wrenches on joints, in joint axes, and loads along coordinates."""

from __future__ import annotations

import pinocchio as pin

from crosscheck.engines.connections import WORLD, Along, Exerted, Moving
from crosscheck.engines.conventions import cross
from crosscheck.engines.links import Attachment
from crosscheck.engines.pinocchio.tree import PinocchioTree
from crosscheck.engines.rigid_tree import TreeConnectors
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class PinocchioConnections:
    """Needs the kinematics of `data` to be up to date."""

    def __init__(self, tree: PinocchioTree, scene: Scene) -> None:
        self._joints = tree.joints
        self._connectors = TreeConnectors(scene, tree.links, tree.slots)

    def __bool__(self) -> bool:
        return bool(self._connectors.between)

    def exerted(self, t: float, data: pin.Data) -> dict[str, Exerted]:
        """What connectors between nodes do, by name."""
        return self._connectors.exerted(t, lambda at: self._frame(at, data))

    def add(self, t: float, data: pin.Data, total: pin.StdVec_Force) -> float:
        """Add their wrenches to those of the joints; their power (W)."""
        exerted = self.exerted(t, data)
        for at, load in self._connectors.loads(exerted):
            joint = self._joints[at.link]
            back, arm = data.oMi[joint].rotation.T, at.frame.position
            force = back @ load[3:]
            total[joint] = total[joint] + pin.Force(force, back @ load[:3] + cross(arm, force))
        return sum(each.power for each in exerted.values())

    def along(self, t: float, q: Real, v: Real) -> dict[str, tuple[int, Along]]:
        """By name the speed that a connector along a hinge acts on, and what it does."""
        return self._connectors.along(t, q, v)

    def _frame(self, at: Attachment, data: pin.Data) -> Moving:
        if at.link < 0:
            return WORLD.carrying(at.frame)
        joint = self._joints[at.link]
        pose, speed = data.oMi[joint], data.v[joint]
        R = pose.rotation
        return Moving(pose.translation, R, R @ speed.angular, R @ speed.linear).carrying(at.frame)
