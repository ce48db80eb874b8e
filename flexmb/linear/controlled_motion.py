"""Derivatives of the motion under controllers, by all displacements and speeds, forces, time and states of controllers.

How the laws close the loop: `flexmb.linear.closed_loop`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flexmb.control.law_derivatives import LawDerivatives
from flexmb.linear.closed_loop import ClosedLoop
from flexmb.linear.equations import built
from flexmb.linear.sensed import ChangedRow, sensed
from flexmb.scene.schema import Scene
from flexmb.system.derivative_records import EvaluationDerivatives, OfControlledMotion, by_names
from flexmb.system.linearisation import FreeRow
from flexmb.system.system import System
from flexmb.tables.per_thread import per_thread
from flexmb.tables.state import State, finite_result
from flexmb.typing import Real


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
        self._loop  # noqa: B018  (raises what cannot be built)

    @per_thread
    def _loop(self) -> ClosedLoop:
        return ClosedLoop(self._shared)

    @property
    def state_names(self) -> list[str]:
        """Names of the states (X,) of continuous controllers, "law.state[0]"."""
        return self._loop.feedback.state_names

    def initial_states(self, state: State, held: Mapping[str, Any] | None = None) -> Real:
        """(X,) with which continuous controllers begin at a state of the motion."""
        return self._loop.initial(self._loop.entering(state), {} if held is None else held)

    def acceleration_derivatives(
        self, state: State, states: Sequence[float] | Real | None = None, held: Mapping[str, Any] | None = None
    ) -> ControlledDerivatives:
        """Derivatives of `System.acceleration_derivatives` under the controllers, and of the rates of their states."""
        at, plant = self._at(state, states, held), self._loop.plant
        place, split = plant.observation.columns["rates"][0], partial(_split, plant.nu)
        return ControlledDerivatives(
            at.row.value[place], at.laws.values[len(self._loop.feedback.driven) :], split(at.change[place]),
            split(at.of_rates), at.row.motion,
        )  # fmt: skip

    def evaluation_derivatives(
        self, state: State, states: Sequence[float] | Real | None = None, held: Mapping[str, Any] | None = None
    ) -> EvaluationDerivatives[OfControlledMotion]:
        """Derivatives of everything observable, by the names of `System.evaluation_derivatives`."""
        at, plant = self._at(state, states, held), self._loop.plant
        return by_names(plant.observation, at.row.value, at.change, partial(_split, plant.nu))

    def _at(self, state: State, states: Sequence[float] | Real | None, held: Mapping[str, Any] | None) -> _At:
        loop, plant = self._loop, self._loop.plant
        state = loop.entering(state)
        laws = loop.laws(state, states, {} if held is None else held)
        row = plant.linearisation.free_row(state, "ControlledMotion")
        moving, time = np.zeros((plant.nq + plant.nu, row.change.shape[1])), np.eye(row.change.shape[1])[-1]
        moving[: plant.nq, : plant.nu], moving[plant.nq :, plant.nu : 2 * plant.nu] = row.motion, np.eye(plant.nu)
        seen = sensed(plant, ChangedRow(row.value, row.change, moving))
        seen[:, -1] += loop.feedback.rates_of_time(state.t)
        found = loop.chained(state, laws, seen, time)
        change = np.pad(row.change, [(0, 0), (0, laws.by_state.shape[1])]) + found.by_drive @ found.driven
        return _At(row, laws, change, finite_result(found.rates, state.t))


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
