"""From a state of the vehicle to what engines exchange: World axes, angular first, scalar-first.

Basilisk gives states and their rates, energy and momentum. The motion of the parts follows from their coordinates;
loads of hinges and wheels are not available.
"""

from __future__ import annotations

from crosscheck.engines.basilisk.craft import HUB, CraftPart
from crosscheck.engines.basilisk.dynamics import CraftDynamics, CraftSolution, CraftState
from crosscheck.engines.contract import Snapshot
from crosscheck.engines.conventions import axis_rotation, cross, rotation_matrix
from crosscheck.engines.links import by_motion
from crosscheck.engines.tree_observer import BodyMotion, Energies, TreeObserver
from flexmb.scene.schema import Scene


def moved(at: BodyMotion, part: CraftPart, value: float, rate: float, acceleration: float) -> BodyMotion:
    """The motion of a part whose joint's inboard frame moves like this."""
    axis, w = at.rotation @ part.freedom.axis, at.angular
    if by_motion(part.freedom, True, False):
        alpha = at.alpha + axis * acceleration + cross(w, axis * rate)
        return at._replace(
            rotation=at.rotation @ axis_rotation(part.freedom.axis, value), angular=w + axis * rate, alpha=alpha
        )
    arm = axis * value
    linear = at.acceleration + cross(at.alpha, arm) + cross(w, cross(w, arm) + 2.0 * axis * rate) + axis * acceleration
    return at._replace(
        position=at.position + arm, linear=at.linear + cross(w, arm) + axis * rate, acceleration=linear
    )


class BasiliskObserver(TreeObserver):
    def __init__(self, dynamics: CraftDynamics, scene: Scene) -> None:
        super().__init__(scene, dynamics.craft.links)
        self._dynamics = dynamics
        self._motions: dict[int, BodyMotion] = {}

    def observe(self, t: float, state: CraftState) -> Snapshot:
        dynamics = self._dynamics
        self._motions = self._moving(state, dynamics.solve(t, state))
        stored = 0.5 * float(dynamics.stiffness @ state.values**2)  # as Basilisk counts it, at rest at zero
        spring = 0.5 * float(dynamics.stiffness @ (state.values - dynamics.rest) ** 2)
        energies = Energies(dynamics.vehicle.energy(t) - stored, spring, 0.0)
        momentum = dynamics.vehicle.momentum(self._motions[HUB].rotation, state.velocity, state.turning)
        return self.snapshot(None, {}, energies, momentum)

    def body_motion(self, link: int) -> BodyMotion:
        part, frame = self._dynamics.craft.where[link]
        return self._motions[part].carrying(frame)

    def _moving(self, state: CraftState, solved: CraftSolution) -> dict[int, BodyMotion]:
        R = rotation_matrix(state.quaternion)
        hub = BodyMotion(state.position, R, R @ state.turning, state.velocity, R @ solved.angular, solved.linear)
        motions = {HUB: hub}
        for number, part in enumerate(self._dynamics.craft.parts):
            joint = motions[part.parent].carrying(part.inboard)
            own = (float(column[number]) for column in (state.values, state.rates, solved.parts))
            motions[number] = moved(joint, part, *own)
        return motions
