"""Derivatives of the accelerations of an OpenSim tree: by differences, those by forces from Simbody's mass matrix.

What rests has no accelerations, but weights that cancel with rounding. By Cauchy's inequality those of all bodies along
a speed are together at most |g| sqrt(m M_kk), with the mass m of all and the mass matrix M.
"""

from __future__ import annotations

import numpy as np

from crosscheck.engines.conventions import quaternion_rate
from crosscheck.engines.linear.coordinates import obstacle
from crosscheck.engines.linear.matrices import (
    EPS,
    Errors,
    LinearMatrices,
    differentiated,
    norm,
    quaternion_transport,
    rounding,
)
from crosscheck.engines.linear.slots import slot_places
from crosscheck.engines.opensim.dynamics import OpensimDynamics
from crosscheck.engines.opensim.tree import outboard_rotation
from crosscheck.engines.rigid_tree import TreeState
from flexmb.scene.schema import Scene
from flexmb.typing import Real


def linearised(dynamics: OpensimDynamics, scene: Scene) -> OpensimLinear | None:
    """None for scenes whose derivatives are not offered."""
    return None if obstacle(scene) else OpensimLinear(dynamics, scene)


class OpensimLinear:
    def __init__(self, dynamics: OpensimDynamics, scene: Scene) -> None:
        self._dynamics = dynamics
        slots = slot_places(scene, dynamics.tree.slots, dynamics.tree.nv, linear_first=False)
        self._places = slots.places
        self._turning, self._moving = ([slot.v for slot in each] for each in (slots.balls, slots.flying))
        mass = sum(link.inertia.mass for link in dynamics.tree.links)
        self._weight = norm(np.array(scene.gravity_m_s2)) * np.sqrt(mass)

    def at(self, t: float, state: TreeState) -> LinearMatrices:
        """The derivatives at a state, in the order that all engines share."""
        places, n = self._places, len(self._places)
        square = np.ix_(places, places)
        udot = self._accelerations(t, state)
        inverse = self._dynamics.inverse_mass(state)
        mass = np.linalg.inv(inverse)
        by_force = np.linalg.inv(mass[square])
        unit = rounding(by_force, len(state.v))
        weights = self._weight * np.sqrt(np.diag(mass)[places])
        noise = unit * norm(udot) + EPS * np.sqrt(n) * (norm(state.v) + norm(np.abs(by_force) @ weights))
        by_displacement, apart = differentiated(lambda xi: self._accelerations(t, self._moved(state, xi)), n, noise)
        by_speed, asunder = differentiated(lambda du: self._accelerations(t, self._hurried(state, du)), n, noise)
        transport = quaternion_transport(state.v, self._turning, self._moving)[square]
        errors = Errors(apart, asunder, unit * norm(by_force))
        return LinearMatrices(by_displacement, by_speed, by_force, transport, errors)

    def _accelerations(self, t: float, state: TreeState) -> Real:
        """(n,) of the shared coordinates."""
        return self._dynamics.outboard(state, self._dynamics.solve(t, state).acceleration)[self._places]

    def _hurried(self, state: TreeState, du: Real) -> TreeState:
        v = state.v.copy()
        v[self._places] += du
        return state._replace(v=v)

    def _moved(self, state: TreeState, xi: Real) -> TreeState:
        """A state that is displaced by xi (n,) to the first order, on a smooth path."""
        coordinates = self._dynamics.coordinates
        q, moved = state.q.copy(), np.zeros(len(state.v))
        moved[self._places] = xi
        q[coordinates.scalar_q] += moved[coordinates.scalar_v]
        for slot, place, _, turning, moving in coordinates.turning:
            if moving is not None:
                q[slot.q : slot.q + 3] += outboard_rotation(slot, state.q) @ moved[moving]
            q[place] += quaternion_rate(q[place], moved[turning])
            q[place] /= norm(q[place])
        return state._replace(q=q)
