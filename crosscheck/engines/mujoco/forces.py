"""What MuJoCo cannot hold in its model: motors, loads at nodes, connectors, and prescribed
accelerations as functions of time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

from crosscheck.engines.connections import WORLD, Along, Exerted, Moving
from crosscheck.engines.conventions import cross
from crosscheck.engines.functions_of_time import Signals, profile
from crosscheck.engines.links import Attachment
from crosscheck.engines.mujoco.tree import ARMATURE, MujocoSlot, MujocoTree
from crosscheck.engines.rigid_tree import JointForces, PointLoad, TreeConnectors, motors, placed_loads
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class Forces:
    """Writes applied forces into `data` at every stage of a step, through MuJoCo's control callback.

    The callback is global to the process: `active` sets it and always takes it away again. `before_end` (s) caps the
    time seen by the functions, so that the last stage before a jump sees the limit from the left. `signals` are those
    of the scene's controllers, which act in motors and loads.
    """

    def __init__(self, tree: MujocoTree, scene: Scene, signals: Signals | None = None) -> None:
        self.driven: list[MujocoSlot] = [slot for slot in tree.slots if slot.driven]
        self._motions = [(slot.q, slot.v, profile(slot.freedom.prescribed)) for slot in self.driven]
        self._motors = motors(tree.slots, signals)
        self._pushed: tuple[float, list[tuple[int, float]]] = np.nan, []  # the last result of `_pushes`, with its time
        self._follows_time = signals is None  # alone
        self._loads = [_BodyWrench(tree, link, load) for link, load in placed_loads(scene, tree.links, signals)]
        self.spring_energy = JointForces(tree.slots, tree.model.nv, _unit, signals).spring_energy
        self.connections = MujocoConnections(tree, scene)
        self._connected = bool(self.connections)
        self.before_end = np.inf

    @contextmanager
    def active(self) -> Iterator[None]:
        if not (self._motions or self._motors or self._loads or self.connections):
            yield
            return
        mujoco.set_mjcb_control(self._apply)
        try:
            yield
        finally:
            mujoco.set_mjcb_control(None)

    def follow(self, t: float, data: mujoco.MjData) -> None:
        """Set the prescribed coordinates to their functions of time."""
        for q, v, motion in self._motions:
            data.qpos[q], data.qvel[v], _ = motion(t)

    def _apply(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        t = min(data.time, self.before_end)
        if self._connected:
            data.qfrc_applied[:] = 0.0
        applied = data.qfrc_applied
        for index, push in self._pushes(t):
            applied[index] = push
        if self._loads or self._connected:
            data.xfrc_applied[:] = 0.0
            for load in self._loads:
                load.add(t, data)
            self.connections.add(t, data)

    def _pushes(self, t: float) -> list[tuple[int, float]]:
        """Indices of speeds with their motor loads or the loads of their prescribed motion.

        The last result is kept, since stages of a step share their times.
        """
        if t != self._pushed[0] or not self._follows_time:
            efforts = [(index, motor(t).value) for index, motor in self._motors]
            following = [(v, ARMATURE * motion(t).acceleration) for _, v, motion in self._motions]
            self._pushed = t, efforts + following
        return self._pushed[1]


class _BodyWrench:
    """A force or torque at a node, handed to MuJoCo as a wrench [force; torque] at the mass centre in World axes."""

    def __init__(self, tree: MujocoTree, link: int, load: PointLoad) -> None:
        self._body, self._load = int(tree.bodies[link]), load
        self._arm = load.point - tree.links[link].inertia.com

    def add(self, t: float, data: mujoco.MjData) -> None:
        R = data.xmat[self._body].reshape(3, 3)
        vector = self._load.in_world(t, R)
        if self._load.is_force:
            data.xfrc_applied[self._body, :3] += vector
            data.xfrc_applied[self._body, 3:] += cross(R @ self._arm, vector)
        else:
            data.xfrc_applied[self._body, 3:] += vector


def _unit(quaternion: Real) -> Real:
    return quaternion / np.linalg.norm(quaternion)


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
