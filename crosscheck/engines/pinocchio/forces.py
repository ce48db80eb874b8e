"""Loads at nodes of a Pinocchio tree, as wrenches on its joints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from crosscheck.engines.conventions import cross
from crosscheck.engines.pinocchio.tree import PinocchioTree
from crosscheck.engines.rigid_tree import PointLoad, placed_loads
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class PlacedLoads:
    """Loads at nodes as wrenches on the joints, in joint axes; needs the kinematics of `data` to be up to date."""

    def __init__(self, tree: PinocchioTree, scene: Scene) -> None:
        self._loads = [_JointWrench(tree.joints[link], load) for link, load in placed_loads(scene, tree.links)]
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
