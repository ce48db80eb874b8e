"""Everything that acts on a Pinocchio tree besides gravity: springs, dampers, motors, loads at nodes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from crosscheck.engines.conventions import cross, rotation_vector, scalar_first
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.links import Ball, Scalar, attachment
from crosscheck.engines.pinocchio.tree import PinocchioSlot, PinocchioTree, Places, places
from crosscheck.engines.rigid_tree import PointLoad
from flexmb.scene.schema import Load, Scene
from flexmb.typing import Real


class JointForces:
    """Generalised forces (nv,) of springs, of dampers and of motors."""

    def __init__(self, tree: PinocchioTree) -> None:
        scalars = [slot for slot in tree.slots if isinstance(slot.freedom, Scalar)]
        sprung = [slot for slot in scalars if slot.freedom.stiffness]
        damped = [slot for slot in scalars if slot.freedom.damping]
        self._nv = tree.model.nv
        self._spring_q, self._spring_v = _indices(sprung)
        self._stiffness = np.array([slot.freedom.stiffness for slot in sprung])
        self._rest = np.array([slot.freedom.rest for slot in sprung])
        _, self._damper_v = _indices(damped)
        self._damping = np.array([slot.freedom.damping for slot in damped])
        self._motors = [(slot.v, profile(slot.freedom.effort)) for slot in scalars if slot.freedom.effort is not None]
        self._balls = [
            slot
            for slot in tree.slots
            if isinstance(slot.freedom, Ball) and (slot.freedom.stiffness or slot.freedom.damping)
        ]
        self.loses = bool(damped or self._motors or self._balls)  # else dampers and motors give nothing

    def springs(self, q: Real) -> Real:
        tau = np.zeros(self._nv)
        if len(self._stiffness):
            tau[self._spring_v] = -self._stiffness * (q[self._spring_q] - self._rest)
        for slot in self._balls:
            tau[slot.v : slot.v + 3] = -slot.freedom.stiffness * _turn(slot, q)
        return tau

    def dampers_and_motors(self, t: float, v: Real) -> Real:
        tau = np.zeros(self._nv)
        tau[self._damper_v] = -self._damping * v[self._damper_v]
        for slot in self._balls:
            tau[slot.v : slot.v + 3] = -slot.freedom.damping * v[slot.v : slot.v + 3]
        for index, motor in self._motors:
            tau[index] += motor(t).value
        return tau

    def spring_energy(self, q: Real) -> float:
        energy = 0.5 * self._stiffness @ (q[self._spring_q] - self._rest) ** 2
        for slot in self._balls:
            turn = _turn(slot, q)
            energy += 0.5 * slot.freedom.stiffness * (turn @ turn)
        return float(energy)


class PlacedLoads:
    """Loads at nodes as wrenches on the joints, in joint axes; needs the kinematics of `data` to be up to date."""

    def __init__(self, tree: PinocchioTree, scene: Scene) -> None:
        self._loads = [_JointWrench(tree, scene, load) for load in scene.loads]
        self._none = pin.StdVec_Force()
        self._none.extend([pin.Force.Zero() for _ in range(tree.model.njoints)])

    def __bool__(self) -> bool:
        return bool(self._loads)

    def wrenches(self, t: float, data: pin.Data) -> tuple[pin.StdVec_Force, float]:
        """Of all joints, and their power (W)."""
        total, power = pin.StdVec_Force(self._none), 0.0
        for load in self._loads:
            wrench = load.wrench(t, data)
            total[load.joint] = total[load.joint] + wrench
            power += wrench.dot(data.v[load.joint])
        return total, power

    def fixed_in_world(self, t: float, data: pin.Data) -> Iterator[tuple[int, Real]]:
        """The joint of every load in World axes, and d wrench/d xi_w (6,3) [linear; angular] by its rotation.

        Both are in joint axes.
        """
        for load in self._loads:
            if load.turns:
                yield load.joint, load.turned(t, data)


class _JointWrench:
    def __init__(self, tree: PinocchioTree, scene: Scene, load: Load) -> None:
        at = attachment(scene, tree.links, load)
        self.joint = tree.joints[at.link]
        self._load = PointLoad(load, at.frame)

    @property
    def turns(self) -> bool:
        """Whether it turns as seen from the joint."""
        return self._load.fixed_in_world

    def turned(self, t: float, data: pin.Data) -> Real:
        """Joint axes that turn by xi_w see a load f of World turn by -xi_w: df = f x xi_w."""
        force = pin.skew(self._load.in_body(t, data.oMi[self.joint].rotation))
        if self._load.is_force:
            return np.vstack([force, pin.skew(self._load.point) @ force])
        return np.vstack([np.zeros((3, 3)), force])

    def wrench(self, t: float, data: pin.Data) -> pin.Force:
        R = data.oMi[self.joint].rotation
        vector = self._load.in_body(t, R)
        if self._load.is_force:
            return pin.Force(vector, cross(self._load.point, vector))
        return pin.Force(np.zeros(3), vector)


def _indices(slots: list[PinocchioSlot]) -> tuple[Places, Places]:
    return places([slot.q for slot in slots]), places([slot.v for slot in slots])


def _turn(slot: PinocchioSlot, q: Real) -> Real:
    return rotation_vector(scalar_first(q[slot.q : slot.q + 4]))
