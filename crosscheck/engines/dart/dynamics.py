"""Hybrid dynamics of a DART tree as an ordinary differential equation.

The state is that of `FreeCoordinates`, speeds of free joints in outboard axes. DART takes accelerations of driven
coordinates as commands and returns their forces.
"""

from __future__ import annotations

from typing import NamedTuple

import dartpy
import numpy as np

from crosscheck.engines.conventions import cross, quaternion_rate, rotate_spatial, rotation_matrix, rotation_vector
from crosscheck.engines.dart.tree import DartTree, initial_state
from crosscheck.engines.links import Ball, Floating
from crosscheck.engines.rigid_tree import FreeCoordinates, JointForces, PointLoad, TreeState, placed_loads
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class DartSolution(NamedTuple):
    """DART's accelerations (nv,), loads of the driven coordinates (d,), power of all but springs and gravity (W)."""

    acceleration: Real
    drive: Real
    power: float


class DartDynamics:
    def __init__(self, tree: DartTree, scene: Scene) -> None:
        self.tree = tree
        self.forces = JointForces(tree.slots, tree.skeleton.getNumDofs())
        self._coordinates = FreeCoordinates(tree.slots, tree.nq, tree.skeleton.getNumDofs())
        self.driven = self._coordinates.driven
        self._loads = DartLoads(tree, scene)
        self._balls = [slot for slot in tree.slots if isinstance(slot.freedom, Ball)]
        self._floating = [slot for slot in tree.slots if isinstance(slot.freedom, Floating)]

    def initial(self) -> Real:
        return self._coordinates.packed(*initial_state(self.tree))

    def state(self, t: float, y: Real) -> TreeState:
        return self._coordinates.state(t, y)

    def solve(self, t: float, state: TreeState) -> DartSolution:
        """Accelerations and drive loads; the skeleton keeps the state, its accelerations and its joint loads."""
        skeleton, D = self.tree.skeleton, self._coordinates.driven_v
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
        coordinates = self._coordinates
        qdot, vdot = np.empty(self.tree.nq), solution.acceleration.copy()
        qdot[coordinates.scalar_q] = state.v[coordinates.scalar_v]
        for slot, place, own in coordinates.turning:  # rates of quaternions depend on their values as integrated
            qdot[place] = quaternion_rate(y[own], state.v[slot.v : slot.v + 3])
        for slot in self._floating:
            speeds = slice(slot.v, slot.v + 6)
            R, v = rotation_matrix(state.q[slot.q + 3 : slot.q + 7]), state.v[speeds]
            qdot[slot.q : slot.q + 3] = R @ v[3:]
            changing = rotate_spatial((slot.link.inboard.rotation @ R).T, vdot[speeds])
            vdot[speeds] = changing - np.concatenate([np.zeros(3), cross(v[:3], v[3:])])
        return coordinates.rate(qdot, vdot, solution.power)

    def _speeds(self, state: TreeState) -> Real:
        """DART's speeds (nv,) of the scene's."""
        speeds = state.v.copy()
        for slot in self._floating:
            R = slot.link.inboard.rotation @ rotation_matrix(state.q[slot.q + 3 : slot.q + 7])
            speeds[slot.v : slot.v + 6] = rotate_spatial(R, state.v[slot.v : slot.v + 6])
        return speeds

    def _positions(self, q: Real) -> Real:
        """DART's coordinates (nv,) of the scene's (nq,)."""
        positions = np.empty(self.tree.skeleton.getNumDofs())
        positions[self._coordinates.scalar_v] = q[self._coordinates.scalar_q]
        for slot in self._balls:
            positions[slot.v : slot.v + 3] = _rotation_vector(q[slot.q : slot.q + 4])
        for slot in self._floating:
            positions[slot.v : slot.v + 6] = [*_rotation_vector(q[slot.q + 3 : slot.q + 7]), *q[slot.q : slot.q + 3]]
        return positions


def _rotation_vector(quaternion: Real) -> Real:
    """The rotation vector (3,) from which DART makes the rotation.

    For small angles DART truncates a series after the second order. Below 1e-5 rad the error is less than round-off;
    from there to 1e-2 rad, well beyond the range of the series, the vector of angle - 2 pi is used.
    """
    vector = rotation_vector(quaternion)
    angle = np.sqrt(vector @ vector)
    return vector * (1.0 - 2.0 * np.pi / angle) if 1e-5 < angle < 1e-2 else vector


class DartLoads:
    """Loads at nodes, put on the bodies of a tree that is in the state of the time asked for."""

    def __init__(self, tree: DartTree, scene: Scene) -> None:
        self._skeleton = tree.skeleton
        self._loads = [_DartLoad(tree.bodies[link], load) for link, load in placed_loads(scene, tree.links)]

    def __bool__(self) -> bool:
        return bool(self._loads)

    def apply(self, t: float) -> float:
        """Replace what acts on the bodies; returns the power (W)."""
        self._skeleton.clearExternalForces()
        return sum(load.apply(t) for load in self._loads)


class _DartLoad:
    def __init__(self, body: dartpy.dynamics.BodyNode, load: PointLoad) -> None:
        self._body, self._load = body, load

    def apply(self, t: float) -> float:
        R = self._body.getWorldTransform().rotation()
        vector, point = self._load.in_world(t, R), self._load.point
        turning = self._body.getAngularVelocity()
        if not self._load.is_force:
            self._body.addExtTorque(vector, False)
            return float(vector @ turning)
        self._body.addExtForce(vector, point, False, True)
        return float(vector @ (self._body.getLinearVelocity() + cross(turning, R @ point)))
