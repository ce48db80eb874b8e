"""Connectors on a Pinocchio tree: wrenches on joints, in joint axes, and loads along coordinates."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from crosscheck.engines.connections import WORLD, Along, Exerted, Moving, along_hinges, connections
from crosscheck.engines.links import Attachment, Scalar
from crosscheck.engines.pinocchio.tree import PinocchioTree
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class PinocchioConnections:
    """Needs the kinematics of `data` to be up to date."""

    def __init__(self, tree: PinocchioTree, scene: Scene) -> None:
        self._joints = tree.joints
        self._between = connections(scene, tree.links)
        self._along = []
        for name, item, number, load in along_hinges(scene):
            slots = [slot for slot in tree.slots if slot.link.joint == item and isinstance(slot.freedom, Scalar)]
            self._along.append((name, slots[number], load))

    def __bool__(self) -> bool:
        return bool(self._between)

    def exerted(self, t: float, data: pin.Data) -> dict[str, Exerted]:
        """What connectors between nodes do, by name."""
        return {
            each.name: each.exerted(t, self._frame(each.a, data), self._frame(each.b, data)) for each in self._between
        }

    def add(self, t: float, data: pin.Data, total: pin.StdVec_Force) -> None:
        """Add their wrenches to those of the joints."""
        found = self.exerted(t, data)
        for each in self._between:
            for at, load in ((each.a, found[each.name].on_a), (each.b, found[each.name].on_b)):
                if at.link >= 0:
                    joint = self._joints[at.link]
                    back, arm = data.oMi[joint].rotation.T, at.frame.position
                    force = back @ load[3:]
                    total[joint] = total[joint] + pin.Force(force, back @ load[:3] + np.cross(arm, force))

    def power(self, t: float, data: pin.Data) -> float:
        """Of what is not elastic in them."""
        return sum(each.power for each in self.exerted(t, data).values())

    def along(self, t: float, q: Real, v: Real) -> dict[str, tuple[int, Along]]:
        """By name the speed that a connector along a hinge acts on, and what it does."""
        return {name: (slot.v, load(t, float(q[slot.q]), float(v[slot.v]))) for name, slot, load in self._along}

    def _frame(self, at: Attachment, data: pin.Data) -> Moving:
        if at.link < 0:
            return WORLD.carrying(at.frame)
        joint = self._joints[at.link]
        pose, speed = data.oMi[joint], data.v[joint]
        R = pose.rotation
        return Moving(pose.translation, R, R @ speed.angular, R @ speed.linear).carrying(at.frame)
