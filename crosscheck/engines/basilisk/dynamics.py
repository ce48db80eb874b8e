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
from crosscheck.engines.connections import Moving
from crosscheck.engines.conventions import quaternion_of, quaternion_rate, rotation_matrix, shift_wrench
from crosscheck.engines.functions_of_time import Profile, profile
from crosscheck.engines.links import Scalar
from crosscheck.engines.rigid_tree import TreeLoads
from flexmb.scene.schema import Scene
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
        self._loads = TreeLoads(scene, craft.links, ())

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
        """Apply the loads, all of which are on the hub; returns their power (W)."""
        R = rotation_matrix(state.quaternion)
        hub = Moving(state.position, R, R @ state.turning, state.velocity)
        wrenches, power = self._loads.wrenches(t, lambda link: hub.carrying(self.craft.where[link][1]))
        total = np.zeros(6)
        for link, wrench in wrenches.items():
            total += shift_wrench(wrench, R @ self.craft.where[link][1].position)
        self.vehicle.push(total[3:], R.T @ total[:3])
        return power


def _motor(freedom: Scalar):
    return _still if freedom.effort is None else profile(freedom.effort)


def _still(t: float) -> Profile:
    return Profile(0.0, 0.0, 0.0)
