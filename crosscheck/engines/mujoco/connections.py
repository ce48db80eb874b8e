"""Connectors on a MuJoCo tree: wrenches at mass centres in World axes, and loads along coordinates."""

from __future__ import annotations

import mujoco

from crosscheck.engines.connections import WORLD, Along, Exerted, Moving
from crosscheck.engines.conventions import cross
from crosscheck.engines.links import Attachment
from crosscheck.engines.mujoco.tree import MujocoTree
from crosscheck.engines.rigid_tree import TreeConnectors
from flexmb.scene.schema import Scene


class MujocoConnections:
    """Evaluated in the control callback, where positions and velocities of `data` are up to date."""

    def __init__(self, tree: MujocoTree, scene: Scene) -> None:
        self._tree = tree
        self._connectors = TreeConnectors(scene, tree.links, tree.slots)

    def __bool__(self) -> bool:
        return bool(self._connectors)

    def exerted(self, t: float, data: mujoco.MjData) -> dict[str, Exerted]:
        """What connectors between nodes do, by name."""
        return self._connectors.exerted(t, lambda at: self._frame(at, data))

    def along(self, t: float, data: mujoco.MjData) -> dict[str, tuple[int, Along]]:
        """By name the speed that a connector along a hinge acts on, and what it does."""
        return self._connectors.along(t, data.qpos, data.qvel)

    def add(self, t: float, data: mujoco.MjData) -> None:
        for at, load in self._connectors.loads(self.exerted(t, data)):
            body = self._tree.bodies[at.link]
            arm = self._frame(at, data).position - data.xipos[body]
            data.xfrc_applied[body, :3] += load[3:]
            data.xfrc_applied[body, 3:] += load[:3] + cross(arm, load[3:])
        for speed, held in self.along(t, data).values():
            data.qfrc_applied[speed] += held.load

    def _frame(self, at: Attachment, data: mujoco.MjData) -> Moving:
        if at.link < 0:
            return WORLD.carrying(at.frame)
        body = self._tree.bodies[at.link]
        w, position = data.cvel[body, :3], data.xpos[body]
        pole = data.subtree_com[self._tree.model.body_rootid[body]]
        linear = data.cvel[body, 3:] + cross(w, position - pole)
        return Moving(position, data.xmat[body].reshape(3, 3), w, linear).carrying(at.frame)
