"""The motion under continuous controllers at one state: its derivatives, in which the forces of controllers change too.

Let z be the state of the motion, forces along it, and time, x the states of the controllers, y the signals of sensors
and v what the controllers drive. With v held, everything observable has exact derivatives by z, and those by v are
exact up to rounding, because the motion is linear in v. The laws v = g(y, x, t) and x' = l(y, x, t) close the loop:

    dv = g_y y_z dz + g_x dx + g_t dt    dy = y_z dz + y_v dv    dx' = l_y dy + l_x dx + l_t dt

g_y y_v = 0: scenes in which a force depends on itself, through a load or an acceleration, are refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.control.law_derivatives import LawDerivatives, law_derivatives
from flexmb.control.loop import project
from flexmb.control.loop_run import FreshStart
from flexmb.linear.equations import equations_of
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.sensed import ChangedRow, readable, sensed
from flexmb.linear.variations import Equations
from flexmb.system import algorithms
from flexmb.system.system import System
from flexmb.tables.arguments import finite, vector
from flexmb.tables.state import State
from flexmb.typing import Real

LARGE = 2.0**20
"""Change of a drive, whose effect is linear: large, so that the rounding of other loads is negligible."""
REMEDY = "flexmb.linearize_sampled(scene) gives the discrete one; or linearise flexmb.open_loop(scene)"


class Chained(NamedTuple):
    """Derivatives along k directions of the motion, then by x: of the D drives (D,k+X) and of the rates of x (X,k+X);
    by the drives: of everything observable (E,D) and of the signals (S,D)."""

    driven: Real
    rates: Real
    by_drive: Real
    said: Real


class ClosedLoop:
    """A system with its controllers at single states, for one thread: controllers write what they drive to the
    functions of time of a copy of the system."""

    def __init__(self, system: System) -> None:
        self.plant = plant = copy(system)
        route = plant.route()
        self.feedback = Feedback(plant, algorithms.chosen("articulated"), route, route.tables())

    def entering(self, state: State) -> State:
        """The state, checked; of a closed chain with its closures closed."""
        self.plant.layout.entering(state)
        return self.plant.admissible(state, "state") if self.plant.constraints else state

    def initial(self, state: State, held: Mapping[str, Any]) -> Real:
        """(X,) with which continuous controllers begin at a state, with these outputs of sampled controllers."""
        return self.feedback.begin_at(FreshStart(state), held)[self.plant.nq + self.plant.nu : -1].copy()

    def laws(self, state: State, states: Any, held: Mapping[str, Any], one_sided: bool = False) -> LawDerivatives:
        """The laws at a state and these states of controllers (X,), None for their initial ones; the functions of time
        have what is driven afterwards. `NotDifferentiableError` where a law has a corner, unless `one_sided`."""
        start = self.plant.nq + self.plant.nu
        y = self.feedback.begin_at(FreshStart(state), held)
        if states is not None:
            y[start:-1] = finite("states", vector("states", states, len(y) - 1 - start))
        project(state.t, y.copy(), self.feedback.running)  # finds the independent rows of closures
        return law_derivatives(self.feedback, state.t, y, one_sided)

    def chained(self, state: State, laws: LawDerivatives, seen: Real, time: Real) -> Chained:
        """The laws closed, from the derivatives (S,k) of the signals along k directions with drives held, in which time
        advances by `time` (k,)."""
        drives = len(self.feedback.driven)
        row = self._by_drives(state, laws.values[:drives])
        said = readable(laws.by_signal, sensed(self.plant, row))
        along = laws.by_signal @ readable(laws.by_signal, seen) + np.outer(laws.by_time, time)
        driven, rates = np.vsplit(np.hstack([along, laws.by_state]), [drives])
        return Chained(driven, rates + laws.by_signal[drives:] @ said @ driven, row.change, said)

    def _by_drives(self, state: State, driven: Real) -> ChangedRow:
        """Everything observable, along changes of what controllers drive, which has the values `driven` (D,)."""
        now, found = self._row(state), np.zeros((self.plant.observation.width, len(driven)))
        for i, value in enumerate(driven):
            self.feedback.put_drive(i, value + LARGE)
            found[:, i] = (self._row(state) - now) / LARGE
            self.feedback.put_drive(i, value)
        return ChangedRow(now, found, np.zeros((self.plant.nq + self.plant.nu, len(driven))))

    def _row(self, state: State) -> Real:
        row = np.empty(self.plant.observation.width)
        self.plant.observe_row(state.t, np.concatenate([state.q, state.u, [0.0]]), "articulated", row)
        return row


def continuous_loop(system: System) -> ClosedLoop:
    """For linear models, and equilibria by these; NotImplementedError for sampled controllers."""
    sampled = [controller.name for controller in system.scene.controllers if controller.period_s is not None]
    if sampled:
        raise NotImplementedError(
            f'controller "{sampled[0]}" is sampled: a closed loop with instants has no linear model of this kind; '
            f"{REMEDY}"
        )
    return ClosedLoop(system)


def closed_model(
    loop: ClosedLoop, state: State, x: Real | None, of_motion: Callable[[Equations, State], LinearModel],
    one_sided: bool = False,
) -> tuple[LinearModel, Real]:  # fmt: skip
    """The linear model about a state and x (X,), None for the initial ones, and the rates (X,) of x there; its states
    are those of the motion, then x. `of_motion` makes the model of the motion alone.

    `NotDifferentiableError` where a law has a corner, unless `one_sided`: see `law_derivatives`.
    """
    laws, equations = loop.laws(state, x, {}, one_sided), equations_of(loop.plant)
    model = of_motion(equations, state)
    n, k, inputs, more = len(model.rates), len(model.A), len(model.inputs), laws.by_state.shape[1]
    signals = slice(len(model.C) - laws.by_signal.shape[1], None)  # sensors come last
    found = loop.chained(state, laws, np.hstack([model.C, model.D])[signals], np.zeros(k + inputs))
    driven, of_x = (np.delete(of, np.s_[k : k + inputs], axis=1) for of in (found.driven, found.rates))
    A, C = (np.pad(of, [(0, 0), (0, more)]) for of in (model.A, model.C))
    rates = found.by_drive[loop.plant.observation.columns["rates"][0]]
    A[n:] += rates[equations.free[equations.variations(state).chosen]] @ driven
    C[signals] += found.said @ driven
    C[np.isnan(model.C).any(axis=1)] = np.nan  # what is undetermined is so by all states
    whole = replace(
        model, states=(*model.states, *((name, "") for name in loop.feedback.state_names)),
        A=np.vstack([A, of_x]), B=np.vstack([model.B, found.rates[:, k : k + inputs]]), C=C,
    )  # fmt: skip
    return whole, laws.values[len(found.driven) :]
