"""The equations of motion of a vehicle as an ordinary differential equation.

State y = [hub's position in World, quaternion, velocity in World axes, angular velocity in hub axes; wheel speeds;
coordinates and speeds of the parts; work]. The quaternion is integrated as four numbers: its rate is linear in it, so
the norm is an invariant of the exact flow, and everything else uses the normalised one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from crosscheck.engines.basilisk.craft import Craft
from crosscheck.engines.basilisk.vehicle import Vehicle
from crosscheck.engines.conventions import cross, quaternion_of, quaternion_rate, rotation_matrix
from crosscheck.engines.functions_of_time import Profile, profile
from crosscheck.engines.links import Scalar, attachment
from crosscheck.engines.rigid_tree import PointLoad
from flexmb.scene.schema import Load, Scene
from flexmb.typing import Real

_HUB = 13  # numbers of the hub's state


class CraftState(NamedTuple):
    """The hub's position and velocity in World axes, unit quaternion, angular velocity in hub axes; the rest."""

    position: Real
    quaternion: Real
    velocity: Real
    turning: Real
    spins: Real
    values: Real
    rates: Real


class CraftSolution(NamedTuple):
    """Accelerations of the hub, in World and in hub axes, of wheels and of parts; power of all but springs (W)."""

    linear: Real
    angular: Real
    spins: Real
    parts: Real
    power: float


class CraftDynamics:
    def __init__(self, craft: Craft, scene: Scene) -> None:
        self.craft = craft
        self.vehicle = Vehicle(craft)
        self._wheel_motors = [_motor(wheel.spin) for wheel in craft.wheels]
        self._friction = np.array([wheel.spin.damping for wheel in craft.wheels])
        freedoms = [part.freedom for part in craft.parts]
        self._motors = [_motor(freedom) for freedom in freedoms]
        self.stiffness = np.array([freedom.stiffness for freedom in freedoms])
        self.rest = np.array([freedom.rest for freedom in freedoms])
        self._damping = np.array([freedom.damping for freedom in freedoms])
        self._chains = [np.array(chain, dtype=np.intp) for chain in craft.chains]
        self._loads = [_hub_load(craft, scene, load) for load in scene.loads]

    def initial(self) -> Real:
        flight, base = self.craft.flight, self.craft.base
        R = base.rotation @ rotation_matrix(flight.quaternion)
        freedoms = [part.freedom for part in self.craft.parts]
        return np.concatenate(
            [
                base.position + base.rotation @ flight.position,
                quaternion_of(R),
                R @ flight.velocity,
                flight.angular_velocity,
                [wheel.spin.rate for wheel in self.craft.wheels],
                [freedom.value for freedom in freedoms],
                [freedom.rate for freedom in freedoms],
                [0.0],
            ]
        )

    def state(self, t: float, y: Real) -> CraftState:
        wheels, parts = len(self._wheel_motors), len(self._motors)
        quaternion = y[3:7] / np.sqrt(y[3:7] @ y[3:7])
        spins, values, rates = np.split(y[_HUB:-1], [wheels, wheels + parts])
        return CraftState(y[:3], quaternion, y[7:10], y[10:13], spins, values, rates)

    def solve(self, t: float, state: CraftState) -> CraftSolution:
        """The accelerations and the power; the vehicle keeps the state."""
        self.vehicle.put(state.position, state.quaternion, state.velocity, state.turning, state.spins)
        driven = np.array([motor(t).value for motor in self._motors])
        for number, chain in enumerate(self._chains):
            # Basilisk's springs are at rest at zero.
            efforts = driven[chain] + self.stiffness[chain] * self.rest[chain]
            self.vehicle.put_chain(number, state.values[chain], state.rates[chain], efforts)
        torques = np.array([motor(t).value for motor in self._wheel_motors]) - self._friction * state.spins
        self.vehicle.drive_wheels(torques)
        power = self._push(t, state) + torques @ state.spins + (driven - self._damping * state.rates) @ state.rates
        linear, angular, spins, chains = self.vehicle.solve(t)
        parts = np.zeros(len(self._motors))
        for chain, found in zip(self._chains, chains, strict=True):
            parts[chain] = found
        return CraftSolution(linear, angular, spins, parts, float(power))

    def rate(self, t: float, y: Real) -> Real:
        """dy/dt."""
        state = self.state(t, y)
        solved = self.solve(t, state)
        turning = quaternion_rate(y[3:7], state.turning)
        return np.concatenate(
            [
                state.velocity,
                turning,
                solved.linear,
                solved.angular,
                solved.spins,
                state.rates,
                solved.parts,
                [solved.power],
            ]
        )

    def _push(self, t: float, state: CraftState) -> float:
        """Apply the loads to the hub; returns their power (W)."""
        R = rotation_matrix(state.quaternion)
        in_world, on_hub, torque = np.zeros(3), np.zeros(3), np.zeros(3)
        for load in self._loads:
            vector = load.vector(t)
            own = R.T @ vector if load.fixed_in_world else vector
            if not load.is_force:
                torque += own
            else:
                torque += cross(load.point, own)
                if load.fixed_in_world:
                    in_world += vector
                else:
                    on_hub += vector
        self.vehicle.push(in_world, on_hub, torque)
        return float((in_world + R @ on_hub) @ state.velocity + torque @ state.turning)


def _hub_load(craft: Craft, scene: Scene, load: Load) -> PointLoad:
    at = attachment(scene, craft.links, load)
    return PointLoad(load, craft.where[at.link][1] @ at.frame)


def _motor(freedom: Scalar):
    return _still if freedom.effort is None else profile(freedom.effort)


def _still(t: float) -> Profile:
    return Profile(0.0, 0.0, 0.0)
