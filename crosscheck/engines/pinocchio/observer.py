"""From a state of the Pinocchio tree to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.conventions import angular_first, cross, rotate_spatial
from crosscheck.engines.pinocchio.dynamics import Dynamics
from crosscheck.engines.pinocchio.forces import body_motion
from crosscheck.engines.rigid_tree import TreeState, by_joint
from crosscheck.engines.tree_observer import BodyMotion, Energies, TreeObserver
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class PinocchioObserver(TreeObserver):
    def __init__(self, dynamics: Dynamics, scene: Scene) -> None:
        super().__init__(scene, dynamics.tree.links)
        self._dynamics = dynamics
        self._bodies = dynamics.tree.model.copy()
        self._bodies.armature = np.zeros(dynamics.tree.model.nv)

    def body_motion(self, link: int) -> BodyMotion:
        return body_motion(self._dynamics.data, self._dynamics.tree.joints[link])

    def observe(self, t: float, state: TreeState) -> Snapshot:
        dynamics = self._dynamics
        model, data = dynamics.tree.model, dynamics.data
        acceleration, drive, _ = dynamics.solve(t, state)
        dynamics.resolve_loads(t, state, acceleration)
        closed = dynamics.closures.loads() if dynamics.closures else {}
        pin.forwardKinematics(model, data, state.q, state.v, acceleration)
        loads = [
            rotate_spatial(data.oMi[joint].rotation, angular_first(data.f[joint].vector))
            for joint in dynamics.tree.joints
        ]
        pin.computeCentroidalMomentum(model, data, state.q, state.v)
        linear, about_com, com = data.hg.linear, data.hg.angular, data.com[0]
        momentum = np.concatenate([about_com + cross(com, linear), linear])
        weight = pin.computePotentialEnergy(model, data, state.q)
        energies = Energies(self._kinetic(data, state), dynamics.forces.spring_energy(state.q), weight)
        pin.forwardKinematics(model, data, state.q, state.v, acceleration)  # which the two before have overwritten
        return self.snapshot(
            loads, self._drives(drive), energies, momentum, closed=closed | dynamics.rows.loads(data),
            exerted=dynamics.loads.exerted(t, dynamics.link_motion), along=dynamics.loads.along(t, state.q, state.v),
        )  # fmt: skip

    def _kinetic(self, data: pin.Data, state: TreeState) -> float:
        """Of the bodies, and of armatures, which Pinocchio 4.1 leaves out at revolute and screw joints of any axis."""
        of_bodies = pin.computeKineticEnergy(self._bodies, data, state.q, state.v)
        return float(of_bodies + 0.5 * self._dynamics.tree.model.armature @ state.v**2)

    def _drives(self, drive: Real) -> dict[str, Real]:
        """Loads of the prescribed coordinates by joint name; what holds a weld is no drive."""
        own = [(slot, load) for slot, load in zip(self._dynamics.driven, drive, strict=True) if not slot.held]
        return by_joint([slot for slot, _ in own], [load for _, load in own])
