"""From a state of the DART tree to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.conventions import cross, quaternion_of, rotate_spatial
from crosscheck.engines.dart.dynamics import DartDynamics
from crosscheck.engines.links import Attachment, attachment
from crosscheck.engines.rigid_tree import TreeState, by_joint, of_kind
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class DartObserver:
    """DART's body force is the wrench of the parent on the body, about the body's origin and in its axes."""

    def __init__(self, dynamics: DartDynamics, scene: Scene) -> None:
        self._dynamics = dynamics
        self._gravity = np.array(scene.gravity_m_s2, dtype=float)
        self._markers = {marker.name: attachment(scene, dynamics.tree.links, marker) for marker in scene.markers}

    def observe(self, t: float, state: TreeState) -> Snapshot:
        dynamics = self._dynamics
        tree = dynamics.tree
        drive = dynamics.solve(t, state).drive
        wrench = {}
        for link, body in zip(tree.links, tree.bodies, strict=True):
            R = body.getWorldTransform().rotation()
            wrench[link.kind, link.joint] = rotate_spatial(R, body.getBodyForce())
        mass = sum(link.inertia.mass for link in tree.links)
        return Snapshot(
            markers={name: self._marker(at) for name, at in self._markers.items()},
            loads=of_kind("body", wrench),
            wheel_loads=of_kind("wheel", wrench),
            drives=by_joint(dynamics.driven, drive),
            energy={
                "kinetic": tree.skeleton.computeKineticEnergy(),
                "strain": 0.0,
                "spring": dynamics.forces.spring_energy(state.q),
                "gravity": -float(mass * (tree.skeleton.getCOM() @ self._gravity)),
            },
            momentum=self._momentum(),
        )

    def _momentum(self) -> Real:
        """[angular about the World origin; linear] (6,), of all bodies."""
        total = np.zeros(6)
        for link, body in zip(self._dynamics.tree.links, self._dynamics.tree.bodies, strict=True):
            R = body.getWorldTransform().rotation()
            linear = link.inertia.mass * body.getCOMLinearVelocity()
            spin = R @ (link.inertia.inertia @ (R.T @ body.getAngularVelocity()))
            total += np.concatenate([spin + cross(body.getCOM(), linear), linear])
        return total

    def _marker(self, at: Attachment) -> MarkerSnapshot:
        body = self._dynamics.tree.bodies[at.link]
        pose = body.getWorldTransform()
        R, point = pose.rotation(), at.frame.position
        return MarkerSnapshot(
            position=pose.translation() + R @ point,
            quaternion=quaternion_of(R @ at.frame.rotation),
            velocity=np.concatenate([body.getAngularVelocity(), body.getLinearVelocity(point)]),
            acceleration=np.concatenate([body.getAngularAcceleration(), body.getLinearAcceleration(point)]),
        )
