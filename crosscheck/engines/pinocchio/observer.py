"""From a state of the Pinocchio tree to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.conventions import angular_first, cross, quaternion_of, rotate_spatial
from crosscheck.engines.links import attachment
from crosscheck.engines.pinocchio.dynamics import Dynamics
from crosscheck.engines.pinocchio.tree import placement
from crosscheck.engines.rigid_tree import TreeState, by_joint, connector_outputs, of_kind
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class PinocchioObserver:
    """Adds the markers to the model as operational frames, so it must exist before the model's data do."""

    def __init__(self, dynamics: Dynamics, scene: Scene) -> None:
        self._dynamics = dynamics
        tree = dynamics.tree
        self._frames = {}
        for marker in scene.markers:
            at = attachment(scene, tree.links, marker)
            joint = tree.joints[at.link]
            frame = pin.Frame(f"marker {marker.name}", joint, placement(at.frame), pin.FrameType.OP_FRAME)
            self._frames[marker.name] = tree.model.addFrame(frame)
        dynamics.data = tree.model.createData()
        self._bodies = tree.model.copy()
        self._bodies.armature = np.zeros(tree.model.nv)

    def observe(self, t: float, state: TreeState) -> Snapshot:
        dynamics = self._dynamics
        model, data, links = dynamics.tree.model, dynamics.data, dynamics.tree.links
        acceleration, drive, _ = dynamics.solve(t, state)
        dynamics.resolve_loads(t, state, acceleration)
        closed = dynamics.closures.loads() if dynamics.closures else {}
        wrench = {}
        pin.forwardKinematics(model, data, state.q, state.v, acceleration)
        for link, joint in zip(links, dynamics.tree.joints, strict=True):
            local = angular_first(data.f[joint].vector)
            wrench[link.kind, link.joint] = rotate_spatial(data.oMi[joint].rotation, local)
        connected = connector_outputs(
            dynamics.connections.exerted(t, data), dynamics.connections.along(t, state.q, state.v)
        )
        pin.updateFramePlacements(model, data)
        markers = {name: self._marker(frame) for name, frame in self._frames.items()}
        pin.computeCentroidalMomentum(model, data, state.q, state.v)
        linear, about_com, com = data.hg.linear, data.hg.angular, data.com[0]
        return Snapshot(
            markers=markers,
            loads=of_kind("body", wrench) | of_kind("point mass", wrench) | closed | dynamics.rows.loads(data),
            wheel_loads=of_kind("wheel", wrench),
            drives=self._drives(drive),
            energy={
                "kinetic": self._kinetic(data, state),
                "strain": 0.0,
                "spring": dynamics.forces.spring_energy(state.q) + connected.energy,
                "gravity": pin.computePotentialEnergy(model, data, state.q),
            },
            momentum=np.concatenate([about_com + cross(com, linear), linear]),
            connectors=connected.between,
            hinge_forces=connected.along,
        )

    def _kinetic(self, data: pin.Data, state: TreeState) -> float:
        """Of the bodies, and of armatures, which Pinocchio 4.1 leaves out at revolute and screw joints of any axis."""
        of_bodies = pin.computeKineticEnergy(self._bodies, data, state.q, state.v)
        return float(of_bodies + 0.5 * self._dynamics.tree.model.armature @ state.v**2)

    def _marker(self, frame: int) -> MarkerSnapshot:
        model, data = self._dynamics.tree.model, self._dynamics.data
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        pose = data.oMf[frame]
        return MarkerSnapshot(
            position=pose.translation.copy(),
            quaternion=quaternion_of(pose.rotation),
            velocity=angular_first(pin.getFrameVelocity(model, data, frame, world).vector),
            acceleration=angular_first(pin.getFrameClassicalAcceleration(model, data, frame, world).vector),
        )

    def _drives(self, drive: Real) -> dict[str, Real]:
        """Loads of the prescribed coordinates by joint name; what holds a weld is no drive."""
        own = [(slot, load) for slot, load in zip(self._dynamics.driven, drive, strict=True) if not slot.held]
        return by_joint([slot for slot, _ in own], [load for _, load in own])
