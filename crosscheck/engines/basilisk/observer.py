"""From a state of the vehicle to what engines exchange: World axes, angular first, scalar-first.

Basilisk gives states and their rates, energy and momentum. The motion of the parts follows from their coordinates;
loads of hinges and wheels are not available.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from crosscheck.engines.basilisk.craft import HUB, CraftPart
from crosscheck.engines.basilisk.dynamics import CraftDynamics, CraftSolution, CraftState
from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.conventions import Frame, axis_rotation, cross, quaternion_of, rotation_matrix
from crosscheck.engines.links import attachment, by_motion
from flexmb.scene.schema import Scene
from flexmb.typing import Real


@dataclass(frozen=True)
class PartMotion:
    """A frame's rotation (3,3) and position in World, and its velocities and accelerations in World axes."""

    rotation: Real
    position: Real
    turning: Real
    velocity: Real
    angular: Real
    linear: Real

    def at(self, frame: Frame) -> PartMotion:
        """The motion of a frame fixed in this one."""
        arm = self.rotation @ frame.position
        w = self.turning
        velocity = self.velocity + cross(w, arm)
        linear = self.linear + cross(self.angular, arm) + cross(w, cross(w, arm))
        return PartMotion(self.rotation @ frame.rotation, self.position + arm, w, velocity, self.angular, linear)

    def moved(self, part: CraftPart, value: float, rate: float, acceleration: float) -> PartMotion:
        """The motion of a part whose joint's inboard frame moves like this."""
        axis = self.rotation @ part.freedom.axis
        w = self.turning
        if by_motion(part.freedom, True, False):
            rotation = self.rotation @ axis_rotation(part.freedom.axis, value)
            angular = self.angular + axis * acceleration + cross(w, axis * rate)
            return PartMotion(rotation, self.position, w + axis * rate, self.velocity, angular, self.linear)
        arm = axis * value
        velocity = self.velocity + cross(w, arm) + axis * rate
        linear = self.linear + cross(self.angular, arm) + cross(w, cross(w, arm) + 2.0 * axis * rate)
        return PartMotion(self.rotation, self.position + arm, w, velocity, self.angular, linear + axis * acceleration)


class BasiliskObserver:
    def __init__(self, dynamics: CraftDynamics, scene: Scene) -> None:
        self._dynamics = dynamics
        self._markers: dict[str, tuple[int, Frame]] = {}
        for marker in scene.markers:
            at = attachment(scene, dynamics.craft.links, marker)
            part, frame = dynamics.craft.where[at.link]
            self._markers[marker.name] = part, frame @ at.frame

    def observe(self, t: float, state: CraftState) -> Snapshot:
        dynamics = self._dynamics
        motions = self._motions(state, dynamics.solve(t, state))
        stored = 0.5 * float(dynamics.stiffness @ state.values**2)  # as Basilisk counts it, at rest at zero
        energy = dynamics.vehicle.energy(t)
        return Snapshot(
            markers={name: _marker(motions[part].at(frame)) for name, (part, frame) in self._markers.items()},
            loads={},
            wheel_loads={},
            drives={},
            energy={
                "kinetic": energy - stored,
                "strain": 0.0,
                "spring": 0.5 * float(dynamics.stiffness @ (state.values - dynamics.rest) ** 2),
                "gravity": 0.0,
            },
            momentum=dynamics.vehicle.momentum(motions[HUB].rotation, state.velocity, state.turning),
        )

    def _motions(self, state: CraftState, found: CraftSolution) -> dict[int, PartMotion]:
        R = rotation_matrix(state.quaternion)
        hub = PartMotion(R, state.position, R @ state.turning, state.velocity, R @ found.angular, found.linear)
        motions = {HUB: hub}
        for number, part in enumerate(self._dynamics.craft.parts):
            joint = motions[part.parent].at(part.inboard)
            own = (float(column[number]) for column in (state.values, state.rates, found.parts))
            motions[number] = joint.moved(part, *own)
        return motions


def _marker(motion: PartMotion) -> MarkerSnapshot:
    return MarkerSnapshot(
        position=motion.position,
        quaternion=quaternion_of(motion.rotation),
        velocity=np.concatenate([motion.turning, motion.velocity]),
        acceleration=np.concatenate([motion.angular, motion.linear]),
    )
