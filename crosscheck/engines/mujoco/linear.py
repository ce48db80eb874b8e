"""Derivatives of the accelerations of a MuJoCo tree, by MuJoCo's own finite differences of a step.

`mjd_transitionFD` differentiates one step by its state, with central differences. A semi-implicit Euler step of 1 s,
without implicit damping, makes v + qacc of a speed v, so that its derivatives are those of the accelerations whatever
the step. Those of three step sizes of the differences make differences of fourth order with two
(`crosscheck.engines.linear.differences`). The inverse of the mass matrix is by MuJoCo's factors.

Displacements of MuJoCo's joints are those of their speeds. For free flight, three slides in inboard axes and a ball,
ours are in outboard axes: with R from outboard to inboard axes, v_in = R v, so that the accelerations are
R' a_in - w x v, and a rotation that keeps v turns v_in.
"""

from __future__ import annotations

from copy import copy
from typing import assert_never

import mujoco
import numpy as np

from crosscheck.engines.conventions import rotation_matrix
from crosscheck.engines.linear.coordinates import coordinate_names, obstacle, places
from crosscheck.engines.linear.differences import STEP, fourth_order
from crosscheck.engines.linear.matrices import EPS, Errors, StateDerivatives, norm, quaternion_transport, rounding
from crosscheck.engines.linear.slots import slot_names
from crosscheck.engines.links import Ball, Floating, Scalar
from crosscheck.engines.mujoco.forces import Forces
from crosscheck.engines.mujoco.tree import MujocoSlot, MujocoTree
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
        own = [""] * model.nv
        self._turning: list[int] = []
        self._flying: list[MujocoSlot] = []
        for slot, names in slot_names(scene, tree.slots):
            match slot.freedom:
                case Scalar():
                    own[slot.v : slot.v + len(names)] = names
                case Ball():
                    own[slot.v : slot.v + 3] = names
                    self._turning.append(slot.v)
                case Floating():
                    own[slot.v : slot.v + 6] = [*names[3:], *names[:3]]
                    self._flying.append(slot)
                case _:
                    assert_never(slot.freedom)
        self._places = places(coordinate_names(scene), own)

    def at(self, t: float, qpos: Real, qvel: Real) -> StateDerivatives:
        """The derivatives at a state, in the order that all engines share."""
        model, data, nv = self._model, self._data, self._model.nv
        data.time, data.qpos[:], data.qvel[:] = t, qpos, qvel
        with self._forces.active():
            mujoco.mj_forward(model, data)
            inverse = np.empty((nv, nv))
            mujoco.mj_solveM(model, data, inverse, np.eye(nv))
            acceleration = data.qacc.copy()
            steps = [self._step(factor * STEP) for factor in (1.0, 2.0, 4.0)]
        by_q, apart = fourth_order(*(step[nv:, :nv] for step in steps))
        by_v, asunder = fourth_order(*(step[nv:, nv:] - np.eye(nv) for step in steps))
        return self._converted(by_q, by_v, inverse, apart, asunder, acceleration)

    def _step(self, eps: float) -> Real:
        """d [q; v] after a step by d [q; v] before it (2nv,2nv)."""
        model = self._model
        found = np.empty((2 * model.nv, 2 * model.nv))
        mujoco.mjd_transitionFD(model, self._data, eps, True, found, None, None, None)
        return found

    def _converted(
        self, by_q: Real, by_v: Real, inverse: Real, apart: float, asunder: float, acceleration: Real
    ) -> StateDerivatives:
        """In outboard axes of free flights and in the shared order; the errors with the rounding of the differences."""
        nv, qvel = self._model.nv, self._data.qvel
        T, turned = np.eye(nv), np.zeros((nv, nv))
        of_axes, of_speeds = np.zeros((nv, nv)), np.zeros((nv, nv))
        u, udot = qvel.copy(), acceleration.copy()
        for slot in self._flying:
            moving, turning = slice(slot.v, slot.v + 3), slice(slot.v + 3, slot.v + 6)
            quaternion = self._data.qpos[slot.q + 3 : slot.q + 7]
            R = rotation_matrix(quaternion / np.linalg.norm(quaternion))
            w, v, a = qvel[turning], R.T @ qvel[moving], R.T @ acceleration[moving]
            T[moving, moving] = R
            turned[moving, turning] = -R @ _cross(v)
            of_axes[moving, turning] = _cross(a)
            of_speeds[moving, turning], of_speeds[moving, moving] = _cross(v), -_cross(w)
            u[moving], udot[moving] = v, a - np.cross(w, v)
        by_displacement = T.T @ (by_q @ T + by_v @ turned) + of_axes
        by_speed = T.T @ by_v @ T + of_speeds
        square = np.ix_(self._places, self._places)
        by_force = (T.T @ inverse @ T)[square]
        unit = rounding(by_force, nv)
        noise = 1.5 * np.sqrt(nv) / STEP * (unit * norm(udot[self._places]) + EPS * norm(u))
        errors = Errors(apart + asunder * norm(turned) + noise, asunder + noise, unit * norm(by_force))
        return StateDerivatives(by_displacement[square], by_speed[square], by_force, self._transport(u)[square], errors)

    def _transport(self, u: Real) -> Real:
        """Of [linear; angular] speeds of free flights: that of [angular; linear] ones with both halves exchanged."""
        swapped, flying = np.arange(len(u)), [slot.v for slot in self._flying]
        for j in flying:
            swapped[j : j + 6] = [*range(j + 3, j + 6), *range(j, j + 3)]
        return quaternion_transport(u[swapped], self._turning, flying)[np.ix_(swapped, swapped)]


def _cross(v: Real) -> Real:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
