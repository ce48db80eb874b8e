"""Derivatives of the accelerations of a Drake plant, by Drake's automatic differentiation.

The plant is converted to numbers that carry derivatives. Forces that our own system beside the plant computes are held
constant: those of motors and drives depend on time alone, and loads turn with their body only where they are fixed to
it, for which the rotation is differentiated too. Scenes with connectors, sprung ball joints or negative coefficients,
whose forces have no derivatives here, are left out.

Drake counts the speeds of ball joints and of free flight in inboard axes, ours are in outboard ones
(`crosscheck.engines.linear.axes`).
"""

from __future__ import annotations

from typing import assert_never

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, InitializeAutoDiff
from pydrake.math import RigidTransform_, RotationMatrix_
from pydrake.multibody.math import SpatialForce_
from pydrake.multibody.plant import ExternallyAppliedSpatialForce_
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from crosscheck.engines.conventions import rotation_matrix
from crosscheck.engines.drake.actions import Drives, JointActions
from crosscheck.engines.drake.tree import DrakeSlot, DrakeState, DrakeTree, ball_rotation, place
from crosscheck.engines.linear.axes import OutboardAxes
from crosscheck.engines.linear.coordinates import obstacle
from crosscheck.engines.linear.matrices import LinearMatrices, exact, quaternion_transport
from crosscheck.engines.linear.slots import slot_places
from crosscheck.engines.links import Ball, Floating, Scalar
from crosscheck.engines.rigid_tree import PointLoad, TreeLoads
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def linearised(tree: DrakeTree, scene: Scene) -> DrakeLinear | None:
    """None for scenes whose derivatives are not offered."""
    if obstacle(scene) or scene.connectors or any(_without_derivative(slot) for slot in tree.slots):
        return None
    return DrakeLinear(tree, scene)


def _without_derivative(slot: DrakeSlot) -> bool:
    """Whether a force of the slot is computed beside the plant and depends on the state."""
    match slot.freedom:
        case Scalar(stiffness=k, damping=c):
            return k < 0.0 or c < 0.0
        case Ball(stiffness=k, damping=c):
            return k != 0.0 or c < 0.0
        case Floating():
            return False
        case _:
            assert_never(slot.freedom)


class DrakeLinear:
    def __init__(self, tree: DrakeTree, scene: Scene) -> None:
        self._tree = tree
        loads = TreeLoads(scene, tree.links, tree.slots)
        self._joints, self._drives = JointActions(tree, loads), Drives(tree)
        self._loads = [(tree.bodies[link].index(), load) for link, load in loads.at_nodes]
        self._plain = tree.plant.CreateDefaultContext()
        self._plant = tree.plant.ToAutoDiffXd()
        self._context = self._plant.CreateDefaultContext()
        slots = slot_places(scene, tree.slots, tree.plant.num_velocities(), linear_first=False)
        self._places, self._balls, self._flying = slots.places, slots.balls, slots.flying

    def at(self, t: float, state: DrakeState) -> LinearMatrices:
        """The derivatives at a state, in the order that all engines share."""
        n = len(state.v)
        acceleration = self._accelerations(t, state)
        gradient = ExtractGradient(acceleration).reshape(n, -1)
        by_q, by_v, by_tau = gradient[:, :n], gradient[:, n : 2 * n], gradient[:, 2 * n :]
        axes = OutboardAxes(state.v, np.array([component.value() for component in acceleration.ravel()]))
        for slot in (*self._balls, *self._flying):
            R, turning = self._rotation(slot, state), slice(slot.v, slot.v + 3)
            w = R.T @ state.v[turning]
            axes.turned(R, turning, turning, w)
            if slot in self._flying:
                axes.turned(R, slice(slot.v + 3, slot.v + 6), turning, w)
        flying, balls = ([slot.v for slot in slots] for slots in (self._flying, self._balls))
        transport = quaternion_transport(axes.u, balls, flying)
        by_displacement, by_speed = axes.by_displacement(by_q, by_v), axes.by_speed(by_v)
        square = np.ix_(self._places, self._places)
        parts = (by_displacement, by_speed, axes.by_force(by_tau), transport)
        return exact(*(part[square] for part in parts), axes.u, axes.udot)

    def _rotation(self, slot: DrakeSlot, state: DrakeState) -> Real:
        """R (3,3) from outboard to the axes in which Drake counts the speeds of a slot."""
        match slot.freedom:
            case Ball():
                return ball_rotation(slot, state.q)
            case Floating():
                quaternion = state.q[slot.q : slot.q + 4]
                return rotation_matrix(quaternion / np.linalg.norm(quaternion))
            case Scalar():
                raise ValueError(f'"{slot.link.joint}" has no quaternion')
            case _:
                assert_never(slot.freedom)

    def _accelerations(self, t: float, state: DrakeState) -> np.ndarray:
        """(nv,) numbers that carry derivatives by displacements along Drake's speeds, by speeds, and by forces."""
        plant, context, n = self._plant, self._context, len(state.v)
        place(self._tree, self._plain, state)
        rates = np.array([self._tree.plant.MapVelocityToQDot(self._plain, one) for one in np.eye(n)]).T
        xi, du, dtau = np.split(InitializeAutoDiff(np.zeros(3 * n)).ravel(), 3)
        for slot, turned in zip(self._tree.balls, state.turned, strict=True):
            pose = RigidTransform_[AutoDiffXd](RotationMatrix_[AutoDiffXd](turned), slot.link.inboard.position)
            plant.get_joint(slot.joint.index()).frame_on_parent().SetPoseInParentFrame(context, pose)
        context.SetTime(t)
        plant.SetPositions(context, state.q + rates @ xi)
        plant.SetVelocities(context, state.v + du)
        tau = self._joints.forces(t, state.q, state.v, state.turned)
        self._drives.accelerate(t, tau)
        plant.get_applied_generalized_force_input_port().FixValue(context, tau + dtau)
        pushes = [self._push(t, body, load, context) for body, load in self._loads]
        plant.get_applied_spatial_force_input_port().FixValue(context, pushes)
        return plant.get_generalized_acceleration_output_port().Eval(context)

    def _push(self, t: float, body: BodyIndex, load: PointLoad, context: Context) -> object:
        """A load at a point of a body; one that is fixed to the body turns with it."""
        vector = load.in_world(t, np.eye(3))  # as fixed in World or in the body, whichever it is
        if not load.fixed_in_world:
            rotation = self._plant.EvalBodyPoseInWorld(context, self._plant.get_body(body)).rotation()
            vector = rotation.matrix() @ vector
        none = np.zeros(3)
        applied = ExternallyAppliedSpatialForce_[AutoDiffXd]()
        force = SpatialForce_[AutoDiffXd](*((none, vector) if load.is_force else (vector, none)))
        applied.body_index, applied.p_BoBq_B, applied.F_Bq_W = body, load.point, force
        return applied
