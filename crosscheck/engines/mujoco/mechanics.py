"""MuJoCo's accelerations as the right-hand side of a differential equation, for the loop of events and controllers."""

from __future__ import annotations

import mujoco
import numpy as np

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.functions_of_time import Signals
from crosscheck.engines.links import Link, Scalar, links
from crosscheck.engines.mujoco.forces import Forces
from crosscheck.engines.mujoco.observer import MujocoObserver
from crosscheck.engines.mujoco.tree import COUNTING, MujocoSlot, build_tree
from crosscheck.engines.rigid_tree import FreeCoordinates, TreeEquations, TreeState
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def works(scene: Scene) -> bool:
    """Whether the mechanics integrates the work: connectors and drives that move take part in other ways."""
    scalars = (each for link in links(scene) for each in link.freedoms if isinstance(each, Scalar))
    return not (scene.connectors or any(each.prescribed is not None for each in scalars))


class MujocoMechanics(TreeEquations[MujocoSlot]):
    """A tree between two events. Work is that of all but springs and gravity; see `works`."""

    def __init__(self, scene: Scene, chain: tuple[Link, ...], signals: Signals) -> None:
        self._tree = build_tree(chain, np.array(scene.gravity_m_s2, dtype=float))
        self._forces = Forces(self._tree, scene, signals)
        self._observer = MujocoObserver(self._tree, self._forces, scene)
        self.coordinates = FreeCoordinates(self._tree.slots, self._tree.model.nq, self._tree.model.nv, COUNTING)
        self._data = mujoco.MjData(self._tree.model)

    @property
    def slots(self) -> tuple[MujocoSlot, ...]:
        return self._tree.slots

    def motion(self, t: float, state: TreeState) -> tuple[Real, float]:
        data = self._at(t, state)
        with self._forces.active():
            mujoco.mj_forward(self._tree.model, data)
        # qfrc_smooth is the sum of all generalised forces less qfrc_bias, which is that of gravity and of inertia.
        exerted = data.qfrc_smooth + data.qfrc_bias - data.qfrc_spring
        return data.qacc.copy(), float(exerted @ state.v)

    def masses(self, q: Real) -> Real:
        model, data = self._tree.model, self._data
        data.qpos[:] = q
        mujoco.mj_fwdPosition(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        return M

    def observe(self, t: float, state: TreeState) -> Snapshot:
        return self._observer.observe(self._at(t, state))

    def _at(self, t: float, state: TreeState) -> mujoco.MjData:
        data = self._data
        data.time, data.qpos[:], data.qvel[:] = t, state.q, state.v
        return data
