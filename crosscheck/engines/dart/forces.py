"""Everything that acts on a DART tree besides gravity: springs, dampers, motors, loads at nodes."""

from __future__ import annotations

import dartpy
import numpy as np

from crosscheck.engines.conventions import cross, rotation_vector
from crosscheck.engines.dart.tree import DartTree
from crosscheck.engines.links import Ball, attachment
from crosscheck.engines.rigid_tree import PointLoad, motors, scalars
from flexmb.scene.schema import Load, Scene
from flexmb.typing import Real


class DartJointForces:
    """Generalised forces (nv,) of springs, of dampers and of motors, from the scene's coordinates (nq,)."""

    def __init__(self, tree: DartTree) -> None:
        balls = [slot for slot in tree.slots if isinstance(slot.freedom, Ball)]
        self._nv = tree.skeleton.getNumDofs()
        self._springs = [slot for slot in scalars(tree.slots) if slot.freedom.stiffness]
        self._dampers = [slot for slot in scalars(tree.slots) if slot.freedom.damping]
        self._motors = motors(tree.slots)
        self._balls = [slot for slot in balls if slot.freedom.stiffness or slot.freedom.damping]

    def springs(self, q: Real) -> Real:
        tau = np.zeros(self._nv)
        for slot in self._springs:
            tau[slot.v] = -slot.freedom.stiffness * (q[slot.q] - slot.freedom.rest)
        for slot in self._balls:
            tau[slot.v : slot.v + 3] = -slot.freedom.stiffness * rotation_vector(q[slot.q : slot.q + 4])
        return tau

    def dampers_and_motors(self, t: float, v: Real) -> Real:
        tau = np.zeros(self._nv)
        for slot in self._dampers:
            tau[slot.v] = -slot.freedom.damping * v[slot.v]
        for slot in self._balls:
            tau[slot.v : slot.v + 3] = -slot.freedom.damping * v[slot.v : slot.v + 3]
        for index, motor in self._motors:
            tau[index] += motor(t).value
        return tau

    def spring_energy(self, q: Real) -> float:
        energy = sum(0.5 * slot.freedom.stiffness * (q[slot.q] - slot.freedom.rest) ** 2 for slot in self._springs)
        for slot in self._balls:
            turn = rotation_vector(q[slot.q : slot.q + 4])
            energy += 0.5 * slot.freedom.stiffness * (turn @ turn)
        return float(energy)


class DartLoads:
    """Loads at nodes, put on the bodies of a tree that is in the state of the time asked for."""

    def __init__(self, tree: DartTree, scene: Scene) -> None:
        self._skeleton = tree.skeleton
        self._loads = [_DartLoad(tree, scene, load) for load in scene.loads]

    def __bool__(self) -> bool:
        return bool(self._loads)

    def apply(self, t: float) -> float:
        """Replace what acts on the bodies; returns the power (W)."""
        self._skeleton.clearExternalForces()
        return sum(load.apply(t) for load in self._loads)


class _DartLoad:
    def __init__(self, tree: DartTree, scene: Scene, load: Load) -> None:
        at = attachment(scene, tree.links, load)
        self._body: dartpy.dynamics.BodyNode = tree.bodies[at.link]
        self._load = PointLoad(load, at.frame)

    def apply(self, t: float) -> float:
        R = self._body.getWorldTransform().rotation()
        vector, point = self._load.in_world(t, R), self._load.point
        turning = self._body.getAngularVelocity()
        if not self._load.is_force:
            self._body.addExtTorque(vector, False)
            return float(vector @ turning)
        self._body.addExtForce(vector, point, False, True)
        return float(vector @ (self._body.getLinearVelocity() + cross(turning, R @ point)))
