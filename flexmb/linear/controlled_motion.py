"""The motion under continuous controllers at one state, and its derivatives: the forces of controllers change with it.

Let z be the state of the motion, forces along it, and time, x the states of the controllers, y the signals of sensors
and v what the controllers drive. With v held, everything observable has exact derivatives by z, and those by v are
exact up to rounding, because the motion is linear in v. The laws v = g(y, x, t) and x' = l(y, x, t) close the loop:

    dv = g_y y_z dz + g_x dx + g_t dt    dy = y_z dz + y_v dv    dx' = l_y dy + l_x dx + l_t dt

g_y y_v = 0: scenes in which a force depends on itself, through a load or an acceleration, are refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.control.law_derivatives import LawDerivatives, law_derivatives
from flexmb.control.loop_run import FreshStart
from flexmb.linear.equations import built
from flexmb.linear.sensed import ChangedRow, readable, sensed
from flexmb.scene.schema import Scene
from flexmb.system import algorithms
from flexmb.system.derivative_records import EvaluationDerivatives, OfControlledMotion, by_names
from flexmb.system.linearisation import FreeRow
from flexmb.system.system import System
from flexmb.tables.arguments import finite, vector
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State, finite_result
from flexmb.typing import Real

LARGE = 2.0**20
"""Change of a drive, whose effect is linear: large, so that the rounding of other loads is negligible."""


class ControlledDerivatives(NamedTuple):
    """Of the accelerations (nu,) and of the rates (X,) of the states of controllers. motion (nq,nu): dq of
    displacements, as in `AccelerationDerivatives`."""

    accelerations: Real
    rates: Real
    of_accelerations: OfControlledMotion
    of_rates: OfControlledMotion
    motion: Real


class ControlledMotion:
    """A scene with controllers at single states; `system.acceleration_derivatives` and its like are without them.

        motion = fm.ControlledMotion(scene)
        d = motion.acceleration_derivatives(state)          # at the initial states of the controllers
        d.of_accelerations.by_displacement                  (nu,nu)
        d.of_accelerations.by_states                        (nu,X)

    All methods take `states` (X,), of continuous controllers, by default their initial ones (of a `Pid` with a filter
    the present error), and `held`: the outputs of sampled controllers by name, by default zero as before their first
    sample. Between samples these are constant, so that nothing depends on them. Threads may share it: each has a copy
    of the system and of the controllers, made at its first call. Laws of users are called by all these threads.

    All methods raise `NotDifferentiableError` (a DynamicsError) where a law has a corner, DynamicsError, ValueError and
    TypeError as the methods of a `System` do.
    """

    def __init__(self, system: System | Scene) -> None:
        """SceneError for a function of a user that cannot be loaded, ValueError for a scene so large that its
        derivatives do not fit into memory, before it is built."""
        if not isinstance(system, System | Scene):
            raise TypeError(f"a System or a Scene is needed, not {type(system).__name__}")
        self._shared = built(system)
        self._feedback  # noqa: B018  (raises what cannot be built)

    @per_thread
    def _plant(self) -> System:
        """A copy for one thread: controllers write what they drive to its functions of time."""
        return copy(self._shared)

    @per_thread
    def _feedback(self) -> Feedback:
        route = self._plant.route()
        return Feedback(self._plant, algorithms.chosen("articulated"), route, route.tables())

    @property
    def state_names(self) -> list[str]:
        """Names of the states (X,) of continuous controllers, "law.state[0]"."""
        return self._feedback.state_names

    def initial_states(self, state: State, held: Mapping[str, Any] | None = None) -> Real:
        """(X,) with which continuous controllers begin at a state of the motion."""
        y = self._feedback.begin_at(FreshStart(self._entering(state)), {} if held is None else held)
        return y[self._plant.nq + self._plant.nu : -1].copy()

    def acceleration_derivatives(
        self, state: State, states: Sequence[float] | Real | None = None, held: Mapping[str, Any] | None = None
    ) -> ControlledDerivatives:
        """Derivatives of `System.acceleration_derivatives` under the controllers, and of the rates of their states."""
        at = self._at(state, states, held)
        place = self._plant.observation.columns["rates"][0]
        split = partial(_split, self._plant.nu)
        return ControlledDerivatives(
            at.row.value[place], at.laws.values[len(self._feedback.driven) :], split(at.change[place]),
            split(at.of_rates), at.row.motion,
        )  # fmt: skip

    def evaluation_derivatives(
        self, state: State, states: Sequence[float] | Real | None = None, held: Mapping[str, Any] | None = None
    ) -> EvaluationDerivatives[OfControlledMotion]:
        """Derivatives of everything observable, by the names of `System.evaluation_derivatives`."""
        at = self._at(state, states, held)
        return by_names(self._plant.observation, at.row.value, at.change, partial(_split, self._plant.nu))

    def _at(self, state: State, states: Sequence[float] | Real | None, held: Mapping[str, Any] | None) -> _At:
        plant, feedback, state = self._plant, self._feedback, self._entering(state)
        y = self._begin(state, states, {} if held is None else held)
        laws = law_derivatives(feedback, state.t, y)
        row = plant.linearisation.free_row(state, "ControlledMotion")
        drives, k = len(feedback.driven), row.change.shape[1]
        moving, still = np.zeros((plant.nq + plant.nu, k)), np.zeros((plant.nq + plant.nu, drives))
        moving[: plant.nq, : plant.nu], moving[plant.nq :, plant.nu : 2 * plant.nu] = row.motion, np.eye(plant.nu)
        by_drive = self._by_drives(state, laws.values[:drives])
        seen = sensed(plant, ChangedRow(row.value, row.change, moving))
        seen[:, -1] += feedback.rates_of_time(state.t)
        said = sensed(plant, ChangedRow(row.value, by_drive, still))
        seen, said = readable(laws.by_signal, seen), readable(laws.by_signal, said)

        def through(of: Real, by_state: Real, by_time: Real) -> Real:
            """Derivatives along z, then by x, of what reads signals that change so along z."""
            along = of @ seen
            along[:, -1] += by_time
            return np.hstack([along, by_state])

        driven = through(laws.by_signal[:drives], laws.by_state[:drives], laws.by_time[:drives])
        of_rates = through(laws.by_signal[drives:], laws.by_state[drives:], laws.by_time[drives:])
        of_rates += laws.by_signal[drives:] @ said @ driven
        change = np.hstack([row.change, np.zeros((len(row.change), laws.by_state.shape[1]))]) + by_drive @ driven
        return _At(row, laws, change, finite_result(of_rates, state.t))

    def _entering(self, state: State) -> State:
        """The state, checked; of a closed chain with its closures closed."""
        self._plant.layout.entering(state)
        return self._plant.admissible(state, "state") if self._plant.constraints else state

    def _begin(self, state: State, states: Any, held: Mapping[str, Any]) -> Real:
        """y (n,) = [q, u, x, work] with these states and outputs of sampled controllers in force."""
        feedback, start = self._feedback, self._plant.nq + self._plant.nu
        y = feedback.begin_at(FreshStart(state), held)
        if states is not None:
            y[start:-1] = finite("states", vector("states", states, len(y) - 1 - start))
        return y

    def _by_drives(self, state: State, driven: Real) -> Real:
        """(E,D) derivatives of everything observable by what controllers drive, which has the values `driven` (D,)."""
        now, found = self._row(state), np.zeros((self._plant.observation.width, len(driven)))
        for i, value in enumerate(driven):
            self._feedback.put_drive(i, value + LARGE)
            found[:, i] = (self._row(state) - now) / LARGE
            self._feedback.put_drive(i, value)
        return found

    def _row(self, state: State) -> Real:
        row = np.empty(self._plant.observation.width)
        self._plant.observe_row(state.t, np.concatenate([state.q, state.u, [0.0]]), "articulated", row)
        return row


class _At(NamedTuple):
    """At a state: the motion with drives held, the laws, and derivatives by displacements, speeds, forces, time and x
    of the row (E,3nu+1+X) and of the rates of x (X,3nu+1+X)."""

    row: FreeRow
    laws: LawDerivatives
    change: Real
    of_rates: Real


def _split(nu: int, change: Real) -> OfControlledMotion:
    """A record of derivatives (...,3nu+1+X)."""
    return OfControlledMotion(
        change[..., :nu], change[..., nu : 2 * nu], change[..., 3 * nu + 1 :], change[..., 2 * nu : 3 * nu],
        change[..., 3 * nu],
    )  # fmt: skip
