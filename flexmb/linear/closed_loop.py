"""The linear model of a scene with continuous controllers: their states follow those of the motion.

Let y = C z + D v + E f be the sensor signals, with the motion z, the drives v and other forces f, and let the laws be

    v = G y + G_x x,    x' = L y + L_x x

G does not depend on loads and accelerations (scenes with such algebraic loops are refused). So G D = G E = 0, and the
laws close the loop. C and E are exact, and D is exact up to rounding, since loads are linear in the drives. For those
of the laws see `flexmb.control.law_derivatives`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.control.law_derivatives import law_derivatives
from flexmb.control.loop import project
from flexmb.control.loop_run import FreshStart
from flexmb.integrate.problem import Accuracy, Clock
from flexmb.linear.equations import equations_of
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.observed import values
from flexmb.linear.sensed import ChangedRow, readable, sensed
from flexmb.linear.variations import Equations
from flexmb.scene.functions import Constant
from flexmb.system import algorithms
from flexmb.system.system import System
from flexmb.tables.state import State
from flexmb.typing import Real

LARGE = 2.0**20
"""Change of a drive, whose effect is linear: large, so that the rounding of other loads is negligible."""
REMEDY = "linearise flexmb.open_loop(scene), and close the loop on that model"


def closed_loop(system: System, state: State, model: Callable[[Equations, State], LinearModel]) -> LinearModel:
    """The linear model about a state and the controllers' initial states; `model` makes that of the motion alone.

    NotImplementedError for sampled controllers.
    """
    if system.constraints:
        state = system.admissible(state, "state")
    loop = ClosedLoop(system, state)
    loop_model = loop.at(state, loop.initial, model)
    return replace(
        loop_model.of_motion,
        states=(*loop_model.of_motion.states, *((name, "") for name in loop.state_names)),
        A=loop_model.A, B=loop_model.B, C=loop_model.C,
    )  # fmt: skip


class AtState(NamedTuple):
    """A closed loop linearised: A, B, C of 2f+X states [xi; du; dx]; rates (X,) of x; the model of the motion alone."""

    A: Real
    B: Real
    C: Real
    rates: Real
    of_motion: LinearModel


class ClosedLoop:
    """A system with continuous controllers, which can be linearised about any state."""

    def __init__(self, system: System, start: State) -> None:
        _refuse(system)
        self._plant = plant = copy(system)
        chosen, route = algorithms.chosen("articulated"), plant.route()
        self._feedback = feedback = Feedback(plant, chosen, route, route.tables())
        clock = Clock(np.array([start.t, start.t + 1.0]), np.array([start.t + 1.0]))
        y = feedback.begin(FreshStart(start), clock, Accuracy(0.0, 0.0, 0, 0), None).y
        self.initial: Real = y[plant.nq + plant.nu : -1]
        """(X,) initial states of the controllers."""
        self.state_names = feedback.state_names
        project(start.t, y, feedback.running)  # also finds the independent rows of closures

    def at(
        self, state: State, x: Real, model: Callable[[Equations, State], LinearModel], one_sided: bool = False
    ) -> AtState:
        """The linearisation about a state of the motion and the states x (X,) of the controllers.

        `NotDifferentiableError` where a law has a corner, unless `one_sided`: see `law_derivatives`.
        """
        plant, feedback = self._plant, self._feedback
        laws = law_derivatives(feedback, state.t, np.concatenate([state.q, state.u, x, [0.0]]), one_sided)
        equations = equations_of(plant)
        of_motion = model(equations, state)
        n, drives = len(of_motion.rates), len(feedback.driven)
        states, sensors = len(x), laws.by_signal.shape[1]
        G, L = laws.by_signal[:drives], laws.by_signal[drives:]
        G_x, L_x = laws.by_state[:drives], laws.by_state[drives:]
        rows = slice(len(of_motion.outputs) - sensors, None)  # sensors come last
        C, E = readable(laws.by_signal, of_motion.C[rows]), readable(laws.by_signal, of_motion.D[rows])
        moved, said = _effect(equations, state, feedback.driven)
        pushed = np.vstack([np.zeros((n, drives)), moved[equations.variations(state).chosen]])
        A = np.block([[of_motion.A + pushed @ G @ C, pushed @ G_x], [L @ (C + said @ G @ C), L_x + L @ said @ G_x]])
        outputs = np.hstack([of_motion.C, np.zeros((len(of_motion.C), states))])
        outputs[rows] += said @ np.hstack([G @ C, G_x])
        outputs[np.isnan(of_motion.C).any(axis=1)] = np.nan  # what is undetermined is so by all states
        return AtState(A, np.vstack([of_motion.B, L @ E]), outputs, laws.values[drives:], of_motion)


def _refuse(system: System) -> None:
    sampled = [controller.name for controller in system.scene.controllers if controller.period_s is not None]
    if sampled:
        raise NotImplementedError(
            f'controller "{sampled[0]}" is sampled: a closed loop with instants has no linear model of this kind; '
            f"{REMEDY}"
        )


def _effect(equations: Equations, state: State, driven: Sequence[int]) -> tuple[Real, Real]:
    """Derivatives of free accelerations (n,D) and sensor signals (S,D) by each drive value; both are linear in it."""
    held, system, now = equations.constant_functions(state.t), equations.system, values(equations, state)
    by_drive = np.zeros((len(now), len(driven)))
    for i, f in enumerate(driven):
        changed = Constant(value=held[f].value + LARGE)
        other = equations.with_functions([*held[:f], changed, *held[f + 1 :]])
        by_drive[:, i] = (values(other, state) - now) / LARGE
    still = np.zeros((system.nq + system.nu, len(driven)))
    rates = by_drive[system.observation.columns["rates"][0]][equations.free]
    return rates, sensed(system, ChangedRow(now, by_drive, still))
