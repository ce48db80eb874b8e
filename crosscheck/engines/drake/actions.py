"""What Drake's own elements do not give, as a system beside the plant: motors, drives, loads, balls' springs."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from crosscheck.engines.connections import Exerted, Moving
from crosscheck.engines.conventions import quaternion_of, rotation_vector
from crosscheck.engines.drake.tree import BALLAST, DrakeSlot, DrakeTree, ball_rotation
from crosscheck.engines.functions_of_time import profile
from crosscheck.engines.rigid_tree import LinkMotion, TreeLoads, motors, scalars
from flexmb.typing import Real


class JointActions:
    """Generalised forces (nv,) of motors, connectors along hinges, balls' springs, and negative springs and dampers.

    `turned` are the inboard frames of the ball joints, as in `DrakeState`.
    """

    def __init__(self, tree: DrakeTree, loads: TreeLoads) -> None:
        single = scalars(tree.slots)
        self._loads = loads
        self._nv = tree.plant.num_velocities()
        self._motors = motors(tree.slots)
        self._springs = [slot for slot in single if slot.freedom.stiffness < 0.0]
        self._dampers = [slot for slot in single if slot.freedom.damping < 0.0]
        self._balls = [
            (k, slot) for k, slot in enumerate(tree.balls) if slot.freedom.stiffness or slot.freedom.damping < 0.0
        ]
        self._sprung = [slot for slot in single if slot.freedom.stiffness]

    def __bool__(self) -> bool:
        return bool(self._motors or self._springs or self._dampers or self._balls or self._loads.along_hinges)

    def forces(self, t: float, q: Real, v: Real, turned: tuple[Real, ...]) -> Real:
        tau = np.zeros(self._nv)
        for index, motor in self._motors:
            tau[index] += motor(t).value
        for speed, exerted in self._loads.along(t, q, v).values():
            tau[speed] += exerted.load
        for slot in self._springs:
            tau[slot.v] -= slot.freedom.stiffness * (q[slot.q] - slot.freedom.rest)
        for slot in self._dampers:
            tau[slot.v] -= slot.freedom.damping * v[slot.v]
        for k, slot in self._balls:
            # A rotation vector is the same in inboard and outboard axes; the joint's force is in those of its frame F.
            turn = ball_rotation(slot, q) @ _ball_turn(slot, q, turned[k])
            tau[slot.v : slot.v + 3] -= slot.freedom.stiffness * turn
            tau[slot.v : slot.v + 3] -= min(slot.freedom.damping, 0.0) * v[slot.v : slot.v + 3]
        return tau

    def spring_energy(self, q: Real, turned: tuple[Real, ...]) -> float:
        energy = sum(0.5 * slot.freedom.stiffness * (q[slot.q] - slot.freedom.rest) ** 2 for slot in self._sprung)
        for k, slot in self._balls:
            turn = _ball_turn(slot, q, turned[k])
            energy += 0.5 * slot.freedom.stiffness * (turn @ turn)
        return float(energy)


class Drives:
    def __init__(self, tree: DrakeTree) -> None:
        self.slots: list[DrakeSlot] = [slot for slot in tree.slots if slot.driven]
        self._motions = [(slot, profile(slot.freedom.prescribed)) for slot in self.slots]

    def __bool__(self) -> bool:
        return bool(self.slots)

    def accelerate(self, t: float, tau: Real) -> None:
        """Add to tau (nv,) what moves the rotors."""
        for slot, motion in self._motions:
            tau[slot.v] += BALLAST * motion(t).acceleration

    def follow(self, t: float, q: Real, v: Real) -> None:
        """Put the coordinates where their functions say, so that the integrator's error cannot pile up."""
        for slot, motion in self._motions:
            q[slot.q], v[slot.v], _ = motion(t)


class DrakeLoads:
    """What acts on links, as forces on Drake's bodies at their origins, in World axes.

    `poses` are X_WB of all bodies by their index, `speeds` their spatial velocities V_WB.
    """

    def __init__(self, tree: DrakeTree, loads: TreeLoads) -> None:
        self._loads, self._bodies = loads, [body.index() for body in tree.bodies]

    def __bool__(self) -> bool:
        return self._loads.on_links

    def applied(
        self, t: float, poses: list[RigidTransform], speeds: list[SpatialVelocity]
    ) -> list[ExternallyAppliedSpatialForce]:
        wrenches, _ = self._loads.wrenches(t, self._motion(poses, speeds))
        forces = []
        for link, wrench in wrenches.items():
            force = ExternallyAppliedSpatialForce()
            force.body_index, force.p_BoBq_B = self._bodies[link], np.zeros(3)
            force.F_Bq_W = SpatialForce(wrench[:3], wrench[3:])
            forces.append(force)
        return forces

    def exerted(self, t: float, poses: list[RigidTransform], speeds: list[SpatialVelocity]) -> dict[str, Exerted]:
        """What connectors between nodes do, by name."""
        return self._loads.exerted(t, self._motion(poses, speeds))

    def _motion(self, poses: list[RigidTransform], speeds: list[SpatialVelocity]) -> LinkMotion:
        def of_link(link: int) -> Moving:
            pose, V = poses[k := int(self._bodies[link])], speeds[k]
            return Moving(pose.translation(), pose.rotation().matrix(), V.rotational(), V.translational())

        return of_link


class DrakeActions(LeafSystem):
    """Joint actions, drives and loads as a Drake system, whose outputs go into the plant that is integrated.

    `before_end` (s) caps the time seen by the functions, so that the last stage before a jump sees the limit from the
    left. `turned` are the inboard frames of the ball joints at present.
    """

    def __init__(self, tree: DrakeTree, joints: JointActions, drives: Drives, loads: DrakeLoads) -> None:
        super().__init__()
        self.before_end = np.inf
        self.turned: tuple[Real, ...] = ()
        self._joints, self._drives, self._loads = joints, drives, loads
        self._nq = tree.plant.num_positions()
        states = tree.plant.num_multibody_states()
        self.state = self.DeclareVectorInputPort("state", states)
        self.poses = self.DeclareAbstractInputPort("poses", Value[list[RigidTransform]]())
        self.forces = self.DeclareVectorOutputPort("forces", tree.plant.num_velocities(), self._give_forces)
        self.speeds = self.DeclareAbstractInputPort("speeds", Value[list[SpatialVelocity]]())
        wrenches = Value[list[ExternallyAppliedSpatialForce]]
        self.wrenches = self.DeclareAbstractOutputPort("wrenches", wrenches, self._give_wrenches)

    def _give_forces(self, context: Context, output: BasicVector) -> None:
        t, state = min(context.get_time(), self.before_end), self.state.Eval(context)
        tau = self._joints.forces(t, state[: self._nq], state[self._nq :], self.turned)
        self._drives.accelerate(t, tau)
        output.SetFromVector(tau)

    def _give_wrenches(self, context: Context, output: object) -> None:
        t = min(context.get_time(), self.before_end)
        output.set_value(self._loads.applied(t, self.poses.Eval(context), self.speeds.Eval(context)))


def _ball_turn(slot: DrakeSlot, q: Real, frame: Real) -> Real:
    """Rotation vector (3,) of a ball joint, from the hinge's inboard frame to its outboard one."""
    return rotation_vector(quaternion_of(slot.link.inboard.rotation.T @ frame @ ball_rotation(slot, q)))
