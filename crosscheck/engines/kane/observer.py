"""From a state to what engines exchange: World axes, angular first, scalar-first."""

from __future__ import annotations

import numpy as np

from crosscheck.engines.contract import MarkerSnapshot, Snapshot
from crosscheck.engines.conventions import cross, quaternion_of
from crosscheck.engines.kane.dynamics import KaneDynamics, KaneState
from crosscheck.engines.kane.frames import applied
from flexmb.scene.schema import Wheel
from flexmb.typing import Real


class KaneObserver:
    """Loads are the multipliers of the joints, with their springs, dampers, motors and drives."""

    def __init__(self, dynamics: KaneDynamics) -> None:
        self._dynamics = dynamics
        self._driven = [k for k, each in enumerate(dynamics.joints) if each.coordinate is not None and not each.free]

    def observe(self, t: float, state: KaneState) -> Snapshot:
        dynamics, bodies, b = self._dynamics, state.bodies, self._dynamics.count
        solution = dynamics.solve(state)
        R, eta = bodies.rotation[:b], bodies.eta[:b]
        speeds = np.concatenate(
            [applied(R.transpose(0, 2, 1), bodies.velocity[:b]), bodies.angular[:b], bodies.rate[:b]], 1
        )
        momenta = applied(dynamics.mass_matrix(bodies), speeds)
        linear, angular = applied(R, momenta[:, :3]), applied(R, momenta[:, 3:6])
        hinges = {joint.of.name: load for joint, load in zip(dynamics.joints, solution.load, strict=True)}
        wheels = {joint.of.name for joint in dynamics.joints if isinstance(joint.of, Wheel)}
        loads = {name: load for name, load in hinges.items() if name not in wheels}
        return Snapshot(
            markers=self._markers(state, solution.acceleration),
            loads=loads | {flight.of.name: np.zeros(6) for flight in dynamics.flights},
            wheel_loads={name: hinges[name] for name in wheels},
            drives={dynamics.joints[k].of.name: solution.drive[k : k + 1] for k in self._driven},
            energy={
                "kinetic": 0.5 * float(np.sum(momenta * speeds)),
                "strain": 0.5 * float(np.sum(eta * applied(dynamics.stiffness, eta))),
                "spring": dynamics.spring_energy(state),
                "gravity": self._weight(state),
            },
            momentum=np.concatenate([(angular + cross(bodies.position[:b], linear)).sum(0), linear.sum(0)]),
        )

    def _weight(self, state: KaneState) -> float:
        """Potential energy (J), zero at the World origin."""
        dynamics, bodies, b = self._dynamics, state.bodies, self._dynamics.count
        first = dynamics.moments[:, 0, 1:].reshape(b, 3, -1)  # sum m N
        z = np.concatenate([np.ones((b, 1)), bodies.eta[:b]], axis=1)
        mass = dynamics.moments[:, 0, 0, None]
        centre = mass * bodies.position[:b] + applied(bodies.rotation[:b], applied(first, z))
        return -float(centre.sum(0) @ np.array(dynamics.scene.gravity_m_s2))

    def _markers(self, state: KaneState, acceleration: Real) -> dict[str, MarkerSnapshot]:
        dynamics = self._dynamics
        at = dynamics.markers.at(state.bodies)
        own = [dynamics.numbers[marker.body] for marker in dynamics.scene.markers]
        moved = applied(at.partial, acceleration[own]) + at.remaining
        return {
            marker.name: MarkerSnapshot(at.position[k], quaternion_of(at.axes[k]), at.velocity[k], moved[k])
            for k, marker in enumerate(dynamics.scene.markers)
        }
