"""MuJoCo's accelerations as the right-hand side of a differential equation, for the loop of events and controllers."""

from __future__ import annotations

from typing import assert_never

import mujoco
import numpy as np

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.conventions import quaternion_rate
from crosscheck.engines.functions_of_time import Signals
from crosscheck.engines.links import Ball, Floating, Link, Scalar, links
from crosscheck.engines.mujoco.forces import Forces
from crosscheck.engines.mujoco.observer import MujocoObserver
from crosscheck.engines.mujoco.tree import MujocoSlot, build_tree, initial_state
from crosscheck.engines.rigid_tree import FreeCoordinates, TreeState
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def works(scene: Scene) -> bool:
    """Whether the mechanics integrates the work: connectors and drives that move take part in other ways."""
    scalars = (each for link in links(scene) for each in link.freedoms if isinstance(each, Scalar))
    return not (scene.connectors or any(each.prescribed is not None for each in scalars))


class MujocoMechanics:
    """A tree between two events. Work is that of all but springs and gravity; see `works`."""

    def __init__(self, scene: Scene, chain: tuple[Link, ...], signals: Signals) -> None:
        self._tree = build_tree(chain, np.array(scene.gravity_m_s2, dtype=float))
        self._forces = Forces(self._tree, scene, signals)
        self._observer = MujocoObserver(self._tree, self._forces, scene)
        self._coordinates = FreeCoordinates(self._tree.slots, self._tree.model.nq, self._tree.model.nv)
        self._data = mujoco.MjData(self._tree.model)

    @property
    def slots(self) -> tuple[MujocoSlot, ...]:
        return self._tree.slots

    def initial(self) -> Real:
        return self._coordinates.packed(*initial_state(self._tree))

    def packed(self, q: Real, v: Real) -> Real:
        return self._coordinates.packed(q, v)

    def state(self, t: float, y: Real) -> TreeState:
        return self._coordinates.state(t, y)

    def rate(self, t: float, y: Real) -> Real:
        state, coordinates = self.state(t, y), self._coordinates
        data = self._at(t, state)
        with self._forces.active():
            mujoco.mj_forward(self._tree.model, data)
        qdot = np.empty(self._tree.model.nq)
        qdot[coordinates.scalar_q] = state.v[coordinates.scalar_v]
        for slot, place, own in coordinates.turning:
            match slot.freedom:
                case Ball():
                    omega = state.v[slot.v : slot.v + 3]
                case Floating():  # its slides are in inboard axes
                    qdot[slot.q : slot.q + 3] = state.v[slot.v : slot.v + 3]
                    omega = state.v[slot.v + 3 : slot.v + 6]
                case Scalar():
                    raise ValueError(f'"{slot.link.joint}" has no quaternion')
                case _:
                    assert_never(slot.freedom)
            qdot[place] = quaternion_rate(y[own].tolist(), omega.tolist())
        # qfrc_smooth is the sum of all generalised forces less qfrc_bias, which is that of gravity and of inertia.
        exerted = data.qfrc_smooth + data.qfrc_bias - data.qfrc_spring
        return coordinates.rate(qdot, data.qacc.copy(), float(exerted @ state.v))

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
