"""From a state of the DART tree to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.conventions import cross, rotate_spatial
from crosscheck.engines.dart.dynamics import DartDynamics
from crosscheck.engines.rigid_tree import TreeState, by_joint
from crosscheck.engines.tree_observer import BodyMotion, Energies, TreeObserver
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class DartObserver(TreeObserver):
    """DART's body force is the wrench of the parent on the body, about the body's origin and in its axes."""

    def __init__(self, dynamics: DartDynamics, scene: Scene) -> None:
        super().__init__(scene, dynamics.tree.links)
        self._dynamics = dynamics
        self._mass = sum(link.inertia.mass for link in dynamics.tree.links)

    def observe(self, t: float, state: TreeState) -> Snapshot:
        dynamics, tree = self._dynamics, self._dynamics.tree
        drive = dynamics.solve(t, state).drive
        loads = [rotate_spatial(body.getWorldTransform().rotation(), body.getBodyForce()) for body in tree.bodies]
        energies = Energies(
            tree.skeleton.computeKineticEnergy(), dynamics.forces.spring_energy(state.q),
            -self._mass * (tree.skeleton.getCOM() @ self.gravity),
        )  # fmt: skip
        return self.snapshot(loads, by_joint(dynamics.driven, drive), energies, self._momentum())

    def body_motion(self, link: int) -> BodyMotion:
        body = self._dynamics.tree.bodies[link]
        at = self._dynamics.link_motion(link)
        return BodyMotion(*at, body.getAngularAcceleration(), body.getLinearAcceleration())

    def _momentum(self) -> Real:
        """[angular about the World origin; linear] (6,), of all bodies."""
        total = np.zeros(6)
        for link, body in zip(self._dynamics.tree.links, self._dynamics.tree.bodies, strict=True):
            R = body.getWorldTransform().rotation()
            linear = link.inertia.mass * body.getCOMLinearVelocity()
            spin = R @ (link.inertia.inertia @ (R.T @ body.getAngularVelocity()))
            total += np.concatenate([spin + cross(body.getCOM(), linear), linear])
        return total
