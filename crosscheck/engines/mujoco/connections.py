"""Connectors on a MuJoCo tree: wrenches at mass centres in World axes, and loads along coordinates."""

from __future__ import annotations

import mujoco

from crosscheck.engines.connections import WORLD, Along, Exerted, Moving, along_hinges, connections
from crosscheck.engines.conventions import cross
from crosscheck.engines.links import Attachment, Scalar
from crosscheck.engines.mujoco.tree import MujocoTree
from flexmb.scene.schema import Scene


class MujocoConnections:
    """Evaluated in the control callback, where positions and velocities of `data` are up to date."""

    def __init__(self, tree: MujocoTree, scene: Scene) -> None:
        self._tree = tree
        self._between = connections(scene, tree.links)
        self._along = []
        for name, item, number, load in along_hinges(scene):
            slots = [slot for slot in tree.slots if slot.link.joint == item and isinstance(slot.freedom, Scalar)]
            self._along.append((name, slots[number], load))

    def __bool__(self) -> bool:
        return bool(self._between or self._along)

    def exerted(self, t: float, data: mujoco.MjData) -> dict[str, Exerted]:
        """What connectors between nodes do, by name."""
        return {
            each.name: each.exerted(t, self._frame(each.a, data), self._frame(each.b, data)) for each in self._between
        }

    def along(self, t: float, data: mujoco.MjData) -> dict[str, tuple[int, Along]]:
        """By name the speed that a connector along a hinge acts on, and what it does."""
        return {
            name: (slot.v, load(t, float(data.qpos[slot.q]), float(data.qvel[slot.v])))
            for name, slot, load in self._along
        }

    def add(self, t: float, data: mujoco.MjData) -> None:
        """Add all loads to those that are applied."""
        found = self.exerted(t, data)
        for each in self._between:
            for at, load in ((each.a, found[each.name].on_a), (each.b, found[each.name].on_b)):
                if at.link >= 0:
                    body = self._tree.bodies[at.link]
                    arm = self._frame(at, data).position - data.xipos[body]
                    data.xfrc_applied[body, :3] += load[3:]
                    data.xfrc_applied[body, 3:] += load[:3] + cross(arm, load[3:])
        for speed, held in self.along(t, data).values():
            data.qfrc_applied[speed] += held.load

    def energy(self, t: float, data: mujoco.MjData) -> float:
        """Stored in all of them."""
        stored = sum(each.energy for each in self.exerted(t, data).values())
        return stored + sum(held.energy for _, held in self.along(t, data).values())

    def _frame(self, at: Attachment, data: mujoco.MjData) -> Moving:
        if at.link < 0:
            return WORLD.carrying(at.frame)
        body = self._tree.bodies[at.link]
        w, position = data.cvel[body, :3], data.xpos[body]
        pole = data.subtree_com[self._tree.model.body_rootid[body]]
        linear = data.cvel[body, 3:] + cross(w, position - pole)
        return Moving(position, data.xmat[body].reshape(3, 3), w, linear).carrying(at.frame)
