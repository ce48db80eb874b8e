"""From a state of the OpenSim model to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

from crosscheck.engines.contract import Snapshot
from crosscheck.engines.opensim.dynamics import OpensimDynamics
from crosscheck.engines.opensim.tree import OpensimSlot, matrix, spatial
from crosscheck.engines.rigid_tree import TreeState, by_joint
from crosscheck.engines.tree_observer import BodyMotion, Energies, TreeObserver
from flexmb.scene.schema import Scene
from flexmb.typing import Real


class OpensimObserver(TreeObserver):
    """A joint's reaction on its child is all that the joint transmits, about the child's frame there, in World axes."""

    def __init__(self, dynamics: OpensimDynamics, scene: Scene) -> None:
        super().__init__(scene, dynamics.tree.links)
        self._dynamics = dynamics
        self._matter = dynamics.tree.model.getMatterSubsystem()

    def observe(self, t: float, state: TreeState) -> Snapshot:
        dynamics, tree, matter = self._dynamics, self._dynamics.tree, self._matter
        solution = dynamics.solve(t, state)
        loads = [spatial(joint.calcReactionOnChildExpressedInGround(tree.state)) for joint in tree.joints]
        led = {
            coupling.name: coupling.load(size, self._axis(coupling.slots[0]))
            for coupling, size in zip(dynamics.couplings, solution.coupling.tolist(), strict=True)
        }
        centre = matter.calcSystemMassCenterLocationInGround(tree.state).to_numpy()
        energies = Energies(
            matter.calcKineticEnergy(tree.state), dynamics.forces.spring_energy(state.q),
            -matter.calcSystemMass(tree.state) * (centre @ self.gravity),
        )  # fmt: skip
        return self.snapshot(
            loads, by_joint(dynamics.driven, solution.drive), energies,
            spatial(matter.calcSystemMomentumAboutGroundOrigin(tree.state)), closed=dynamics.closing() | led,
            exerted=dynamics.loads.exerted(t, tree.motion), along=dynamics.loads.along(t, state.q, state.v),
        )  # fmt: skip

    def body_motion(self, link: int) -> BodyMotion:
        tree = self._dynamics.tree
        acceleration = tree.bodies[link].getAccelerationInGround(tree.state)
        return BodyMotion(*tree.motion(link), acceleration.get(0).to_numpy(), acceleration.get(1).to_numpy())

    def _axis(self, slot: OpensimSlot) -> Real:
        """(3,) of a scalar coordinate in World axes: the body that it moves has it fixed."""
        return matrix(slot.body.getTransformInGround(self._dynamics.tree.state).R()) @ slot.freedom.axis
