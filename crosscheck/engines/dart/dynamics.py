"""Hybrid dynamics of a DART tree as an ordinary differential equation.

State y = [free coordinates, free speeds, work], speeds of free joints in outboard axes. Quaternions are integrated as
four numbers: qdot is linear in q, so the norm is an invariant of the exact flow; everything else uses the normalised q.
Driven coordinates follow their functions of time: DART takes their accelerations as commands and returns their forces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.engines.conventions import cross, quaternion_rate, rotate_spatial, rotation_matrix, rotation_vector
from crosscheck.engines.dart.forces import DartJointForces, DartLoads
from crosscheck.engines.dart.tree import DartTree, initial_state
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.links import Ball, Floating
from crosscheck.engines.rigid_tree import scalars
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class DartState(NamedTuple):
    """The scene's coordinates (nq,) with unit quaternions and its speeds (nv,), driven accelerations (d,)."""

    q: Real
    v: Real
    driven: Real


class DartSolution(NamedTuple):
    """DART's accelerations (nv,), loads of the driven coordinates (d,), power of all but springs and gravity (W)."""

    acceleration: Real
    drive: Real
    power: float


class DartDynamics:
    def __init__(self, tree: DartTree, scene: Scene) -> None:
        self.tree = tree
        self.forces = DartJointForces(tree)
        self.driven = [slot for slot in tree.slots if slot.driven]
        self._loads = DartLoads(tree, scene)
        self._motions = [profile(slot.freedom.prescribed) for slot in self.driven]
        self._driven_q = np.array([slot.q for slot in self.driven], dtype=np.intp)
        self._driven_v = np.array([slot.v for slot in self.driven], dtype=np.intp)
        self._free_q = np.setdiff1d(np.arange(tree.nq), self._driven_q)
        self._free_v = np.setdiff1d(np.arange(tree.skeleton.getNumDofs()), self._driven_v)
        self._scalar_q = np.array([slot.q for slot in scalars(tree.slots)], dtype=np.intp)
        self._scalar_v = np.array([slot.v for slot in scalars(tree.slots)], dtype=np.intp)
        self._balls = [slot for slot in tree.slots if isinstance(slot.freedom, Ball)]
        self._floating = [slot for slot in tree.slots if isinstance(slot.freedom, Floating)]
        self._quaternions = [slot.q for slot in self._balls] + [slot.q + 3 for slot in self._floating]

    def initial(self) -> Real:
        q, v = initial_state(self.tree)
        return np.concatenate([q[self._free_q], v[self._free_v], [0.0]])

    def state(self, t: float, y: Real) -> DartState:
        q, v = np.empty(self.tree.nq), np.empty(self.tree.skeleton.getNumDofs())
        split = len(self._free_q)
        q[self._free_q], v[self._free_v] = y[:split], y[split:-1]
        motion = np.array([each(t) for each in self._motions]).reshape(-1, 3)
        q[self._driven_q], v[self._driven_v] = motion[:, 0], motion[:, 1]
        for start in self._quaternions:
            quaternion = q[start : start + 4]
            quaternion /= np.sqrt(quaternion @ quaternion)
        return DartState(q, v, motion[:, 2])

    def solve(self, t: float, state: DartState) -> DartSolution:
        """Accelerations and drive loads; the skeleton keeps the state, its accelerations and its joint loads."""
        skeleton, D = self.tree.skeleton, self._driven_v
        skeleton.setPositions(self._positions(state.q))
        skeleton.setVelocities(self._speeds(state))
        power = self._loads.apply(t) if self._loads else 0.0
        lost = self.forces.dampers_and_motors(t, state.v)
        tau = self.forces.springs(state.q) + lost
        commands = tau.copy()
        commands[D] = state.driven
        skeleton.setCommands(commands)
        skeleton.computeForwardDynamics()
        drive = skeleton.getForces()[D] - tau[D]
        power += lost @ state.v + drive @ state.v[D]
        return DartSolution(skeleton.getAccelerations(), drive, float(power))

    def rate(self, t: float, y: Real) -> Real:
        """dy/dt."""
        state = self.state(t, y)
        solution = self.solve(t, state)
        qdot = np.empty(self.tree.nq)
        qdot[self._scalar_q] = state.v[self._scalar_v]
        vdot = solution.acceleration.copy()
        own = np.empty(self.tree.nq)  # the rates of quaternions depend on their values before normalisation
        own[self._free_q] = y[: len(self._free_q)]
        for slot in self._balls:
            place = slice(slot.q, slot.q + 4)
            qdot[place] = quaternion_rate(own[place], state.v[slot.v : slot.v + 3])
        for slot in self._floating:
            place, speeds = slice(slot.q + 3, slot.q + 7), slice(slot.v, slot.v + 6)
            R, v = rotation_matrix(state.q[place]), state.v[speeds]
            turning = v[:3]
            qdot[slot.q : slot.q + 3] = R @ v[3:]
            qdot[place] = quaternion_rate(own[place], turning)
            changing = rotate_spatial((slot.link.inboard.rotation @ R).T, vdot[speeds])
            vdot[speeds] = changing - np.concatenate([np.zeros(3), cross(turning, v[3:])])
        return np.concatenate([qdot[self._free_q], vdot[self._free_v], [solution.power]])

    def _speeds(self, state: DartState) -> Real:
        """DART's speeds (nv,) of the scene's."""
        found = state.v.copy()
        for slot in self._floating:
            R = slot.link.inboard.rotation @ rotation_matrix(state.q[slot.q + 3 : slot.q + 7])
            found[slot.v : slot.v + 6] = rotate_spatial(R, state.v[slot.v : slot.v + 6])
        return found

    def _positions(self, q: Real) -> Real:
        """DART's coordinates (nv,) of the scene's (nq,)."""
        found = np.empty(self.tree.skeleton.getNumDofs())
        found[self._scalar_v] = q[self._scalar_q]
        for slot in self._balls:
            found[slot.v : slot.v + 3] = _rotation_vector(q[slot.q : slot.q + 4])
        for slot in self._floating:
            found[slot.v : slot.v + 6] = [*_rotation_vector(q[slot.q + 3 : slot.q + 7]), *q[slot.q : slot.q + 3]]
        return found


def _rotation_vector(quaternion: Real) -> Real:
    """The rotation vector (3,) from which DART makes the rotation.

    For small angles DART truncates a series after the second order. Below 1e-5 rad the error is less than round-off;
    from there to 1e-2 rad, well beyond the range of the series, the vector of angle - 2 pi is used.
    """
    vector = rotation_vector(quaternion)
    angle = np.sqrt(vector @ vector)
    return vector * (1.0 - 2.0 * np.pi / angle) if 1e-5 < angle < 1e-2 else vector
