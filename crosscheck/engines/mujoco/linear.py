"""Derivatives of the accelerations of a MuJoCo tree, by MuJoCo's own finite differences of a step.

`mjd_transitionFD` differentiates one step by its state, with central differences. A semi-implicit Euler step of 1 s,
without implicit damping, makes v + qacc of a speed v, so that its derivatives are those of the accelerations whatever
the step. Those of several step sizes make differences of fourth order (`crosscheck.engines.linear.matrices`). The
inverse of the mass matrix is by MuJoCo's factors. Inertias that MuJoCo makes us raise (`mujoco.tree`) change it by
their share, which is part of the errors.

Displacements of MuJoCo's joints are those of their speeds. For free flight, three slides in inboard axes and a ball,
ours are in outboard axes (`crosscheck.engines.linear.axes`).
"""

from __future__ import annotations

from copy import copy
from functools import cache

import mujoco
import numpy as np

from crosscheck.engines.conventions import rotation_matrix
from crosscheck.engines.linear.axes import OutboardAxes, swapped_transport
from crosscheck.engines.linear.coordinates import obstacle
from crosscheck.engines.linear.matrices import EPS, Errors, LinearMatrices, fourth_order, norm, rounding
from crosscheck.engines.linear.slots import slot_places
from crosscheck.engines.mujoco.forces import Forces
from crosscheck.engines.mujoco.tree import LEAST_INERTIA, MujocoTree
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def linearised(tree: MujocoTree, forces: Forces, scene: Scene) -> MujocoLinear | None:
    """None for scenes whose derivatives are not offered."""
    return None if obstacle(scene) else MujocoLinear(tree, forces, scene)


class MujocoLinear:
    def __init__(self, tree: MujocoTree, forces: Forces, scene: Scene) -> None:
        self._forces = forces
        self._model = model = copy(tree.model)
        model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_EULER, 1.0
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
        self._data = mujoco.MjData(model)
        moments = (np.linalg.eigvalsh(link.inertia.inertia)[0] for link in tree.links if link.freedoms)
        self._raised = sum(bool(moment < LEAST_INERTIA) for moment in moments)
        self._slots = slot_places(scene, tree.slots, model.nv, linear_first=True)
        self._places = self._slots.places
        self._square = np.ix_(self._places, self._places)

    def at(self, t: float, qpos: Real, qvel: Real) -> LinearMatrices:
        """The derivatives at a state, in the order that all engines share."""
        model, data, nv = self._model, self._data, self._model.nv
        data.time, data.qpos[:], data.qvel[:] = t, qpos, qvel
        with self._forces.active():
            mujoco.mj_forward(model, data)
            inverse = np.empty((nv, nv))
            mujoco.mj_solveM(model, data, inverse, np.eye(nv))
            axes = self._axes(data.qacc)
            by_force = axes.by_force(inverse)[self._square]
            unit = rounding(by_force, nv)
            parts = norm(axes.u) + norm(np.abs(by_force) @ self._weights()[self._places])
            noise = np.sqrt(nv) * (unit * norm(axes.udot[self._places]) + EPS * parts)
            step = cache(self._step)
            by_q, apart = fourth_order(lambda eps: step(eps)[nv:, :nv], noise)
            by_v, asunder = fourth_order(lambda eps: step(eps)[nv:, nv:] - np.eye(nv), noise)
        asunder += np.sqrt(nv) * EPS  # of the ones, which the derivatives by speeds are beside
        share = self._raised * LEAST_INERTIA * norm(by_force)
        errors = Errors(
            apart + asunder * axes.kept + share * (norm(by_q) + norm(axes.udot[self._places])),
            asunder + share * norm(by_v),
            (unit + share) * norm(by_force),
        )
        transport = swapped_transport(
            axes.u, [slot.v for slot in self._slots.balls], [slot.v for slot in self._slots.flying]
        )
        parts = (axes.by_displacement(by_q, by_v), axes.by_speed(by_v))
        return LinearMatrices(*(part[self._square] for part in parts), by_force, transport[self._square], errors)

    def _weights(self) -> Real:
        """(nv,) sums of the sizes of all bodies' weights along the speeds, which may cancel at rest."""
        model, weights, J = self._model, np.zeros(self._model.nv), np.empty((3, self._model.nv))
        for body in range(1, model.nbody):
            mujoco.mj_jacBodyCom(model, self._data, J, None, body)
            weights += model.body_mass[body] * norm(model.opt.gravity) * np.linalg.norm(J, axis=0)
        return weights

    def _step(self, eps: float) -> Real:
        """d [q; v] after a step by d [q; v] before it (2nv,2nv)."""
        model = self._model
        transition = np.empty((2 * model.nv, 2 * model.nv))
        mujoco.mjd_transitionFD(model, self._data, eps, True, transition, None, None, None)
        return transition

    def _axes(self, acceleration: Real) -> OutboardAxes:
        """The change to outboard axes of the shifts of free flights."""
        axes = OutboardAxes(self._data.qvel, acceleration)
        for slot in self._slots.flying:
            quaternion = self._data.qpos[slot.q + 3 : slot.q + 7]
            R = rotation_matrix(quaternion / np.linalg.norm(quaternion))
            turning = slice(slot.v + 3, slot.v + 6)
            axes.turned(R, slice(slot.v, slot.v + 3), turning, self._data.qvel[turning])
        return axes
