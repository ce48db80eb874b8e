"""Hybrid dynamics of a DART tree as an ordinary differential equation.

The state is that of `FreeCoordinates`, speeds of free joints in outboard axes. DART takes accelerations of driven
coordinates as commands and returns their forces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.engines.connections import Moving
from crosscheck.engines.conventions import cross, rotate_spatial, rotation_matrix, rotation_vector
from crosscheck.engines.dart.tree import DartTree
from crosscheck.engines.links import Ball, Floating
from crosscheck.engines.rigid_tree import FreeCoordinates, JointForces, Slot, TreeEquations, TreeLoads, TreeState
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class DartSolution(NamedTuple):
    """DART's accelerations (nv,), loads of the driven coordinates (d,), power of all but springs and gravity (W)."""

    acceleration: Real
    drive: Real
    power: float


class DartDynamics(TreeEquations[Slot]):
    def __init__(self, tree: DartTree, scene: Scene) -> None:
        self.tree = tree
        self.forces = JointForces(tree.slots, tree.skeleton.getNumDofs())
        self.coordinates = FreeCoordinates(tree.slots, tree.nq, tree.skeleton.getNumDofs())
        self._loads = TreeLoads(scene, tree.links, tree.slots)
        self._balls = [slot for slot in tree.slots if isinstance(slot.freedom, Ball)]
        self._floating = [slot for slot in tree.slots if isinstance(slot.freedom, Floating)]

    def solve(self, t: float, state: TreeState) -> DartSolution:
        """Accelerations and drive loads; the skeleton keeps the state, its accelerations and its joint loads."""
        skeleton, D = self.tree.skeleton, self.coordinates.driven_v
        skeleton.setPositions(self._positions(state.q))
        skeleton.setVelocities(self._speeds(state))
        power = self._load(t) if self._loads.on_links else 0.0
        lost = self.forces.dampers_and_motors(t, state.v)
        tau = self.forces.springs(state.q) + lost
        commands = tau.copy()
        commands[D] = state.driven
        skeleton.setCommands(commands)
        skeleton.computeForwardDynamics()
        drive = skeleton.getForces()[D] - tau[D]
        power += lost @ state.v + drive @ state.v[D]
        return DartSolution(skeleton.getAccelerations(), drive, float(power))

    def motion(self, t: float, state: TreeState) -> tuple[Real, float]:
        solution = self.solve(t, state)
        vdot = solution.acceleration.copy()
        for slot in self._floating:
            speeds = slice(slot.v, slot.v + 6)
            R, v = rotation_matrix(state.q[slot.q + 3 : slot.q + 7]), state.v[speeds]
            changing = rotate_spatial((slot.link.inboard.rotation @ R).T, vdot[speeds])
            vdot[speeds] = changing - np.concatenate([np.zeros(3), cross(v[:3], v[3:])])
        return vdot, solution.power

    def link_motion(self, link: int) -> Moving:
        """How the frame of a link moves in the skeleton's state."""
        body = self.tree.bodies[link]
        pose = body.getWorldTransform()
        return Moving(pose.translation(), pose.rotation(), body.getAngularVelocity(), body.getLinearVelocity())

    def _load(self, t: float) -> float:
        """Replace what acts on the bodies; returns the power (W)."""
        self.tree.skeleton.clearExternalForces()
        wrenches, power = self._loads.wrenches(t, self.link_motion)
        for link, wrench in wrenches.items():
            self.tree.bodies[link].addExtTorque(wrench[:3], False)
            self.tree.bodies[link].addExtForce(wrench[3:], np.zeros(3), False, True)
        return power

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
        positions[self.coordinates.scalar_v] = q[self.coordinates.scalar_q]
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
