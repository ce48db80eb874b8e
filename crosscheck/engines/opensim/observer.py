"""From a state of the OpenSim model to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.conventions import cross, quaternion_of
from crosscheck.engines.links import Attachment, attachment
from crosscheck.engines.opensim.dynamics import OpensimDynamics
from crosscheck.engines.opensim.tree import OpensimSlot, matrix, spatial
from crosscheck.engines.rigid_tree import TreeState, by_joint, connector_outputs, of_kind
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class OpensimObserver:
    """A joint's reaction on its child is all that the joint transmits, about the child's frame there, in World axes."""

    def __init__(self, dynamics: OpensimDynamics, scene: Scene) -> None:
        self._dynamics = dynamics
        self._matter = dynamics.tree.model.getMatterSubsystem()
        self._gravity = np.array(scene.gravity_m_s2, dtype=float)
        self._markers = {marker.name: attachment(scene, dynamics.tree.links, marker) for marker in scene.markers}

    def observe(self, t: float, state: TreeState) -> Snapshot:
        dynamics, tree, matter = self._dynamics, self._dynamics.tree, self._matter
        solution = dynamics.solve(t, state)
        wrench = {
            (link.kind, link.joint): spatial(joint.calcReactionOnChildExpressedInGround(tree.state))
            for link, joint in zip(tree.links, tree.joints, strict=True)
        }
        led = {
            each.name: each.load(size, self._axis(each.slots[0]))
            for each, size in zip(dynamics.couplings, solution.coupling.tolist(), strict=True)
        }
        connected = connector_outputs(dynamics.exerted(t), dynamics.along(t, state))
        centre = matter.calcSystemMassCenterLocationInGround(tree.state).to_numpy()
        return Snapshot(
            markers={name: self._marker(at) for name, at in self._markers.items()},
            loads=of_kind("body", wrench) | dynamics.closing() | led,
            wheel_loads=of_kind("wheel", wrench),
            drives=by_joint(dynamics.driven, solution.drive),
            energy={
                "kinetic": matter.calcKineticEnergy(tree.state),
                "strain": 0.0,
                "spring": dynamics.forces.spring_energy(state.q) + connected.energy,
                "gravity": -float(matter.calcSystemMass(tree.state) * (centre @ self._gravity)),
            },
            momentum=spatial(matter.calcSystemMomentumAboutGroundOrigin(tree.state)),
            connectors=connected.between,
            hinge_forces=connected.along,
        )

    def _axis(self, slot: OpensimSlot) -> Real:
        """(3,) of a scalar coordinate in World axes: the body that it moves has it fixed."""
        return matrix(slot.body.getTransformInGround(self._dynamics.tree.state).R()) @ slot.freedom.axis

    def _marker(self, at: Attachment) -> MarkerSnapshot:
        tree = self._dynamics.tree
        body = tree.motion(at.link)
        place = body.carrying(at.frame)
        acceleration = tree.bodies[at.link].getAccelerationInGround(tree.state)
        alpha, arm = acceleration.get(0).to_numpy(), place.position - body.position
        a = acceleration.get(1).to_numpy() + cross(alpha, arm) + cross(body.angular, cross(body.angular, arm))
        return MarkerSnapshot(
            position=place.position,
            quaternion=quaternion_of(place.rotation),
            velocity=np.concatenate([place.angular, place.linear]),
            acceleration=np.concatenate([alpha, a]),
        )
