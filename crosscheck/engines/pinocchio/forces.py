"""Loads on a Pinocchio tree, at nodes, of connectors and of closures, as wrenches on joints in joint axes, and efforts
along coordinates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from crosscheck.engines.connections import WORLD, Along, Exerted, Moving
from crosscheck.engines.conventions import cross, shift_wrench
from crosscheck.engines.functions_of_time import Signals
from crosscheck.engines.links import Attachment
from crosscheck.engines.pinocchio.tree import PinocchioTree
from crosscheck.engines.rigid_tree import PointLoad, TreeConnectors, placed_loads
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class PlacedLoads:
    """Loads at nodes as wrenches on the joints, in joint axes; needs the kinematics of `data` to be up to date."""

    def __init__(self, tree: PinocchioTree, scene: Scene, signals: Signals | None = None) -> None:
        placed = placed_loads(scene, tree.links, signals)
        self._loads = [_JointWrench(tree.joints[link], load) for link, load in placed]
        self._none = pin.StdVec_Force()
        self._none.extend([pin.Force.Zero() for _ in range(tree.model.njoints)])

    def __bool__(self) -> bool:
        return bool(self._loads)

    def wrenches(self, t: float, data: pin.Data) -> tuple[pin.StdVec_Force, float]:
        """Of all joints, and their power (W)."""
        total, power = pin.StdVec_Force(self._none), 0.0
        for load in self._loads:
            wrench = load.wrench(t, data)
            total[load.joint] = total[load.joint] + wrench
            power += wrench.dot(data.v[load.joint])
        return total, power

    def fixed_in_world(self, t: float, data: pin.Data) -> Iterator[tuple[int, Real]]:
        """The joint of every load in World axes, and d wrench/d xi_w (6,3) [linear; angular] by its rotation.

        Both are in joint axes.
        """
        for load in self._loads:
            if load.turns:
                yield load.joint, load.turned(t, data)


class _JointWrench:
    def __init__(self, joint: int, load: PointLoad) -> None:
        self.joint, self._load = joint, load

    @property
    def turns(self) -> bool:
        """Whether it turns as seen from the joint."""
        return self._load.fixed_in_world

    def turned(self, t: float, data: pin.Data) -> Real:
        """Joint axes that turn by xi_w see a load f of World turn by -xi_w: df = f x xi_w."""
        force = pin.skew(self._load.in_body(t, data.oMi[self.joint].rotation))
        if self._load.is_force:
            return np.vstack([force, pin.skew(self._load.point) @ force])
        return np.vstack([np.zeros((3, 3)), force])

    def wrench(self, t: float, data: pin.Data) -> pin.Force:
        R = data.oMi[self.joint].rotation
        vector = self._load.in_body(t, R)
        if self._load.is_force:
            return pin.Force(vector, cross(self._load.point, vector))
        return pin.Force(np.zeros(3), vector)


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
        return sum(connector.power for connector in exerted.values())

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


class ClosedLoad(NamedTuple):
    """The load of a closure: `wrench` [torque; force] (6,) on B about `place` (3,) m, both in World axes, and the
    joints of A and B, 0 for World."""

    wrench: Real
    place: Real
    sides: tuple[int, int]


def on_joints(model: pin.Model, data: pin.Data, loads: Iterable[ClosedLoad]) -> pin.StdVec_Force:
    """Loads of closures as wrenches on both sides' joints, in joint axes about the joint origin; `data` has the places
    of the joints."""
    total = pin.StdVec_Force()
    total.extend([pin.Force.Zero() for _ in range(model.njoints)])
    for load in loads:
        for joint, sign in zip(load.sides, (-1.0, 1.0), strict=True):
            if joint == 0:
                continue
            pose = data.oMi[joint]
            torque, force = shift_wrench(sign * load.wrench, load.place - pose.translation).reshape(2, 3)
            total[joint] = total[joint] + pin.Force(pose.rotation.T @ force, pose.rotation.T @ torque)
    return total
