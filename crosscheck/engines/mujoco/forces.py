"""What MuJoCo cannot hold in its model: motors, loads at nodes, connectors, and prescribed
accelerations as functions of time.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import mujoco
import numpy as np

from crosscheck.engines.connections import WORLD, Moving
from crosscheck.engines.conventions import cross
from crosscheck.engines.functions_of_time import Signals, profile
from crosscheck.engines.mujoco.tree import ARMATURE, COUNTING, MujocoSlot, MujocoTree
from crosscheck.engines.rigid_tree import JointForces, TreeLoads, motors
from flexmb.scene.schema import Scene


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
        self._tree, self.loads = tree, TreeLoads(scene, tree.links, tree.slots, signals)
        self.spring_energy = JointForces(tree.slots, tree.model.nv, COUNTING, signals).spring_energy
        self.before_end = np.inf

    @contextmanager
    def active(self) -> Iterator[None]:
        if not (self._motions or self._motors or self.loads.on_links or self.loads.along_hinges):
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
        applied, loads = data.qfrc_applied, self.loads
        if loads.between or loads.along_hinges:
            applied[:] = 0.0
        for index, push in self._pushes(t):
            applied[index] = push
        for index, along in loads.along(t, data.qpos, data.qvel).values():
            applied[index] += along.load
        if loads.on_links:
            data.xfrc_applied[:] = 0.0
            motion = self.link_motion if loads.between else self._place  # loads at nodes do not depend on speeds
            wrenches, _ = loads.wrenches(t, lambda link: motion(link, data))
            for link, wrench in wrenches.items():
                body = self._tree.bodies[link]
                force = wrench[3:]
                data.xfrc_applied[body, :3] = force
                data.xfrc_applied[body, 3:] = wrench[:3] + cross(data.xpos[body] - data.xipos[body], force)

    def _place(self, link: int, data: mujoco.MjData) -> Moving:
        """Where the frame of a link is, as if at rest."""
        body = self._tree.bodies[link]
        return Moving(data.xpos[body], data.xmat[body].reshape(3, 3), WORLD.angular, WORLD.linear)

    def link_motion(self, link: int, data: mujoco.MjData) -> Moving:
        """How the frame of a link moves; positions and velocities of `data` are up to date."""
        body = self._tree.bodies[link]
        w, position = data.cvel[body, :3], data.xpos[body]
        pole = data.subtree_com[self._tree.model.body_rootid[body]]
        linear = data.cvel[body, 3:] + cross(w, position - pole)
        return Moving(position, data.xmat[body].reshape(3, 3), w, linear)

    def _pushes(self, t: float) -> list[tuple[int, float]]:
        """Indices of speeds with their motor loads or the loads of their prescribed motion.

        The last result is kept, since stages of a step share their times.
        """
        if t != self._pushed[0] or not self._follows_time:
            efforts = [(index, motor(t).value) for index, motor in self._motors]
            following = [(v, ARMATURE * motion(t).acceleration) for _, v, motion in self._motions]
            self._pushed = t, efforts + following
        return self._pushed[1]
