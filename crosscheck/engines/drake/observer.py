"""From a state of the plant to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import MultibodyForces

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.drake.actions import DrakeLoads, Drives, JointActions
from crosscheck.engines.drake.tree import DrakeState, DrakeTree, place
from crosscheck.engines.rigid_tree import TreeLoads, by_joint
from crosscheck.engines.tree_observer import BodyMotion, Energies, TreeObserver
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class DrakeObserver(TreeObserver):
    """Reads a plant whose rotors are armatures alone: Drake counts rotors in energies and inverse dynamics.

    Drake's reaction is what a joint's constraint and its forces together do to the child body, about the child's frame
    and in its axes, which here are those of the link.
    """

    def __init__(self, tree: DrakeTree, scene: Scene) -> None:
        super().__init__(scene, tree.links)
        self._tree, self._given = tree, TreeLoads(scene, tree.links, tree.slots)
        self._context = tree.plant.CreateDefaultContext()
        self._joints, self._drives = JointActions(tree, self._given), Drives(tree)
        self._loads = DrakeLoads(tree, self._given)

    def observe(self, t: float, state: DrakeState, acceleration: Real) -> Snapshot:
        """`acceleration` (nv,) is that of the plant with the drives' rotors in the same state."""
        plant, context = self._tree.plant, self._context
        context.SetTime(t)
        place(self._tree, context, state)
        drives = self._act(t, state, acceleration)
        momentum = plant.CalcSpatialMomentumInWorldAboutPoint(context, np.zeros(3))
        centre = plant.CalcCenterOfMassPositionInWorld(context)
        energies = Energies(
            plant.CalcKineticEnergy(context), self._joints.spring_energy(state.q, state.turned),
            -plant.CalcTotalMass(context) * (centre @ self.gravity),
        )  # fmt: skip
        return self.snapshot(
            self._reactions(), drives, energies, np.concatenate([momentum.rotational(), momentum.translational()]),
            exerted=self._loads.exerted(t, *self._motion()), along=self._given.along(t, state.q, state.v),
        )  # fmt: skip

    def _act(self, t: float, state: DrakeState, acceleration: Real) -> dict[str, Real]:
        """Apply motors, loads and drives to the plant; the drives, by joint name, from inverse dynamics."""
        plant, context = self._tree.plant, self._context
        tau = self._joints.forces(t, state.q, state.v, state.turned)
        applied = self._loads.applied(t, *self._motion())
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)  # gravity, springs and dampers
        for load in applied:
            body = plant.get_body(load.body_index)
            body.AddInForce(context, load.p_BoBq_B, load.F_Bq_W, plant.world_frame(), forces)
        needed = plant.CalcInverseDynamics(context, acceleration, forces) - tau
        driven = [slot.v for slot in self._drives.slots]
        tau[driven] += needed[driven]
        plant.get_applied_generalized_force_input_port().FixValue(context, tau)
        plant.get_applied_spatial_force_input_port().FixValue(context, applied)
        return by_joint(self._drives.slots, needed[driven])

    def _motion(self) -> tuple[list[RigidTransform], list[SpatialVelocity]]:
        """X_WB and V_WB of all bodies by their index."""
        plant, context = self._tree.plant, self._context
        speeds = plant.get_body_spatial_velocities_output_port().Eval(context)
        return plant.get_body_poses_output_port().Eval(context), speeds

    def _reactions(self) -> list[Real]:
        """[torque; force] (6,) on every link about its frame's origin."""
        plant, context = self._tree.plant, self._context
        reactions = plant.get_reaction_forces_output_port().Eval(context)
        loads = []
        for body, joint in zip(self._tree.bodies, self._tree.joints, strict=True):
            R = body.EvalPoseInWorld(context).rotation().matrix()
            load = reactions[int(joint.index())]
            loads.append(np.concatenate([R @ load.rotational(), R @ load.translational()]))
        return loads

    def body_motion(self, link: int) -> BodyMotion:
        body, context = self._tree.bodies[link], self._context
        pose, velocity = body.EvalPoseInWorld(context), body.EvalSpatialVelocityInWorld(context)
        acceleration = body.EvalSpatialAccelerationInWorld(context)
        return BodyMotion(
            pose.translation(), pose.rotation().matrix(), velocity.rotational(), velocity.translational(),
            acceleration.rotational(), acceleration.translational(),
        )  # fmt: skip
