"""Loads on a Pinocchio tree: at nodes, of connectors and of couplings of coordinates.

They are wrenches on joints, in joint axes, and efforts along coordinates; those of couplings follow from the mass
matrix.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from crosscheck.engines.connections import WORLD, Along, Exerted, Moving
from crosscheck.engines.conventions import cross
from crosscheck.engines.links import Attachment
from crosscheck.engines.pinocchio.tree import PinocchioTree
from crosscheck.engines.rigid_tree import PointLoad, TreeConnectors, placed_couplings, placed_loads
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


class PinocchioCouplings:
    """The couplings of a scene on its tree. `efforts` leaves their loads for `loads`."""

    def __init__(self, tree: PinocchioTree, scene: Scene, driven: list[int]) -> None:
        """`driven`: speeds whose accelerations are given."""
        self._placed, nv = placed_couplings(scene, tree.slots), tree.model.nv
        at = {slot.v: joint for joint, slot in enumerate(tree.slots, 1)}  # the joint of World comes first
        self._joints = [at[each.slots[0].v] for each in self._placed]
        self._model, self._data = tree.model, tree.model.createData()
        self._J = np.array([each.row(nv) for each in self._placed]).reshape(-1, nv)
        self._free = np.setdiff1d(np.arange(nv), driven)
        self._load = np.zeros(len(self._placed))

    def __bool__(self) -> bool:
        return bool(self._placed)

    def efforts(self, q: Real, accelerations: Real) -> Real:
        """(nv,) generalised forces that keep the relations, from the accelerations (nv,) without them.

        J M^-1 J' f = -J a with the mass matrix of the free speeds; the least f where couplings are redundant.
        """
        M = pin.crba(self._model, self._data, q)
        M = np.triu(M) + np.triu(M, 1).T
        J = self._J[:, self._free]
        response = np.linalg.solve(M[np.ix_(self._free, self._free)], J.T)
        self._load = -np.linalg.lstsq(J @ response, self._J @ accelerations, rcond=1e-12)[0]
        return self._J.T @ self._load

    def loads(self, data: pin.Data) -> dict[str, Real]:
        """[torque; force] (6,) by coupling along the axis of what it leads, World axes, of the state solved last."""
        return {
            each.name: each.load(size, data.oMi[joint].rotation @ each.slots[0].freedom.axis)
            for each, joint, size in zip(self._placed, self._joints, self._load.tolist(), strict=True)
        }
