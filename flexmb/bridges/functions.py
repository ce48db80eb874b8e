"""What all bridges hand on: accelerations and inverse dynamics of many states, with their Jacobians.

Both are functions of q (nq,), u (nu,), a third vector (nu,) and the time t. Coordinates are those of the system, with
quaternions of any length; derivatives by them are those of `by_coordinates`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from flexmb.scene.open_loop import refuse_feedback
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real


class Jacobians(NamedTuple):
    """By q (n,nu,nq), u (n,nu,nu), the third argument (n,nu,nu) and time (n,nu)."""

    by_coordinates: Real
    by_speed: Real
    by_third: Real
    by_time: Real


class Function(ABC):
    """A function of n states at once. Its values are NaN at a state where it has none, by which searches shorten their
    steps; derivatives are asked for where a search stands, and raise there."""

    def __init__(self, system: System) -> None:
        """TypeError for anything but a System, NotImplementedError for one with controllers."""
        if not isinstance(system, System):
            raise TypeError(f"a System is needed, not {type(system).__name__}: make one by flexmb.compile(scene)")
        refuse_feedback(system.scene, "a bridge", "linearise the closed loop by flexmb.linearize(scene)")
        self.system = system
        self.shapes: tuple[tuple[int, ...], ...] = (system.nq,), (system.nu,), (system.nu,), ()
        """Of the four arguments at one state."""

    @abstractmethod
    def values(self, q: Real, u: Real, third: Real, t: Real) -> Real:
        """(n,nu) at q (n,nq), u (n,nu), third (n,nu) and t (n,)."""

    @abstractmethod
    def _derivatives(self, state: State, third: Real) -> tuple[Real, Real, Real, Real]:
        """Jacobians at one state."""

    def jacobians(self, q: Real, u: Real, third: Real, t: Real) -> Jacobians:
        """At the same arguments. DynamicsError or ValueError, with a note of its number, for a state without them."""
        n, nu = len(q), self.system.nu
        jacobians = Jacobians(*(np.empty((n, nu, *shape)) for shape in self.shapes))
        for i in range(n):
            try:
                parts = self._derivatives(self.system.state(q[i], u[i], float(t[i])), third[i])
            except (DynamicsError, ValueError) as error:  # no accelerations; not finite, no orientation
                error.add_note(f"derivatives were asked for at this state, {i} of {n} counted from 0")
                raise
            for whole, part in zip(jacobians, parts, strict=True):
                whole[i] = part
        return jacobians


class Accelerations(Function):
    """udot under further generalised forces along the speeds, the third argument."""

    def values(self, q: Real, u: Real, third: Real, t: Real) -> Real:
        third = arguments.array("forces", third)  # products of other types would have other bits
        accelerations = self.system.accelerations_batch(q, u, t).accelerations
        for i in np.flatnonzero(np.any(third, axis=1) & np.isfinite(accelerations).all(axis=1)).tolist():
            state = self.system.state(q[i], u[i], float(t[i]))
            accelerations[i] += self.system.acceleration_derivatives(state).by_force @ third[i]
        return accelerations

    def _derivatives(self, state: State, third: Real) -> tuple[Real, Real, Real, Real]:
        d = self.system.acceleration_derivatives(state, third if np.any(third) else None)
        return d.by_coordinates, d.by_speed, d.by_force, d.by_time


class InverseDynamics(Function):
    """tau for given accelerations, the third argument."""

    def values(self, q: Real, u: Real, third: Real, t: Real) -> Real:
        forces = np.full((len(q), self.system.nu), np.nan)
        for i in range(len(q)):
            try:
                forces[i] = self.system.inverse_dynamics(self.system.state(q[i], u[i], float(t[i])), third[i])
            except (DynamicsError, ValueError):
                continue
        return forces

    def _derivatives(self, state: State, third: Real) -> tuple[Real, Real, Real, Real]:
        d = self.system.inverse_dynamics_derivatives(state, third)
        return d.by_coordinates, d.by_speed, d.by_acceleration, d.by_time
