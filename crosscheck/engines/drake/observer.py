"""From a state of the plant to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.tree import MultibodyForces

from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.conventions import cross, quaternion_of
from crosscheck.engines.drake.actions import DrakeLoads, Drives, JointActions
from crosscheck.engines.drake.tree import DrakeState, DrakeTree, place
from crosscheck.engines.links import Attachment, attachment
from crosscheck.engines.rigid_tree import by_joint, connector_outputs, of_kind
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class DrakeObserver:
    """Reads a plant whose rotors are armatures alone: Drake counts rotors in energies and inverse dynamics.

    Drake's reaction is what a joint's constraint and its forces together do to the child body, about the child's frame
    and in its axes, which here are those of the link.
    """

    def __init__(self, tree: DrakeTree, scene: Scene) -> None:
        self._tree = tree
        self._context = tree.plant.CreateDefaultContext()
        self._joints, self._drives = JointActions(tree, scene), Drives(tree)
        self._loads = DrakeLoads(tree, scene)
        self._gravity = np.array(scene.gravity_m_s2, dtype=float)
        self._names = [(link.kind, link.joint) for link in tree.links]
        self._markers = {marker.name: attachment(scene, tree.links, marker) for marker in scene.markers}

    def observe(self, t: float, state: DrakeState, acceleration: Real) -> Snapshot:
        """`acceleration` (nv,) is that of the plant with the drives' rotors in the same state."""
        plant, context = self._tree.plant, self._context
        context.SetTime(t)
        place(self._tree, context, state)
        drives = self._act(t, state, acceleration)
        loads = dict(zip(self._names, self._reactions(), strict=True))
        connected = connector_outputs(self._loads.exerted(t, *self._motion()), self._joints.held(t, state.q, state.v))
        momentum = plant.CalcSpatialMomentumInWorldAboutPoint(context, np.zeros(3))
        centre = plant.CalcCenterOfMassPositionInWorld(context)
        return Snapshot(
            markers={name: self._marker(at) for name, at in self._markers.items()},
            loads=of_kind("body", loads),
            wheel_loads=of_kind("wheel", loads),
            drives=drives,
            energy={
                "kinetic": plant.CalcKineticEnergy(context),
                "strain": 0.0,
                "spring": self._joints.spring_energy(state.q, state.turned) + connected.energy,
                "gravity": -float(plant.CalcTotalMass(context) * (centre @ self._gravity)),
            },
            momentum=np.concatenate([momentum.rotational(), momentum.translational()]),
            connectors=connected.between,
            hinge_forces=connected.along,
        )

    def _act(self, t: float, state: DrakeState, acceleration: Real) -> dict[str, Real]:
        """Apply motors, loads and drives to the plant; the drives, by joint name, from inverse dynamics."""
        plant, context = self._tree.plant, self._context
        tau = self._joints.forces(t, state.q, state.v, state.turned)
        applied = self._loads.applied(t, *self._motion())
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)  # gravity, springs and dampers
        for load in applied:
            body = plant.get_body(load.body_index)
            arm = body.EvalPoseInWorld(context).rotation().matrix() @ load.p_BoBq_B
            body.AddInForce(context, arm, load.F_Bq_W, plant.world_frame(), forces)
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

    def _marker(self, at: Attachment) -> MarkerSnapshot:
        body, context = self._tree.bodies[at.link], self._context
        pose = body.EvalPoseInWorld(context)
        R = pose.rotation().matrix()
        arm = R @ at.frame.position
        velocity, acceleration = body.EvalSpatialVelocityInWorld(context), body.EvalSpatialAccelerationInWorld(context)
        w, alpha = velocity.rotational(), acceleration.rotational()
        v = velocity.translational() + cross(w, arm)
        a = acceleration.translational() + cross(alpha, arm) + cross(w, cross(w, arm))
        return MarkerSnapshot(
            position=pose.translation() + arm,
            quaternion=quaternion_of(R @ at.frame.rotation),
            velocity=np.concatenate([w, v]),
            acceleration=np.concatenate([alpha, a]),
        )
