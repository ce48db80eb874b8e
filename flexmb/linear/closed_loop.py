"""The linear model of a scene with continuous controllers: their states follow those of the motion.

Let y = C z + D v + E f be the sensor signals, with the motion z, the drives v and other forces f, and let the laws be

    v = G y + G_x x,    x' = L y + L_x x

G does not depend on loads and accelerations (scenes with such algebraic loops are refused). So G D = G E = 0, and the
laws close the loop. C and E are exact, and D is exact up to rounding, since loads are linear in the drives. The laws
accept only plain numbers and are differentiated by differences of fourth order: exact up to rounding for linear laws.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.control.loop import look, project, respond
from flexmb.integrate.problem import Accuracy, Clock
from flexmb.linear.equations import equations_of
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.observed import values
from flexmb.linear.sensed import ChangedRow, sensed
from flexmb.linear.variations import Equations
from flexmb.scene.functions import Constant
from flexmb.system import algorithms
from flexmb.system.closed import ClosedSystem
from flexmb.system.tree_system import System
from flexmb.tables.state import DynamicsError, State
from flexmb.tables.status import OK, Status
from flexmb.typing import Real

LARGE = 2.0**20
"""Change of a drive, whose effect is linear: large, so that the rounding of other loads is negligible."""
REMEDY = "linearise flexmb.open_loop(scene), and close the loop on that model"
STEP = 1e-3
"""Step of differences, in SI units or relative: its fourth power and the rounding divided by it are both 1e-13."""


def closed_loop(system: System, state: State, model: Callable[[Equations, State], LinearModel]) -> LinearModel:
    """The linear model about a state and the controllers' initial states; `model` makes that of the motion alone.

    NotImplementedError for sampled controllers.
    """
    if isinstance(system, ClosedSystem):
        state = system.admissible(state, "state")
    loop = ClosedLoop(system, state)
    found = loop.at(state, loop.initial, model)
    return replace(
        found.of_motion,
        states=(*found.of_motion.states, *((name, "") for name in loop.state_names)),
        A=found.A, B=found.B, C=found.C,
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
        y = feedback.begin(_Start(start), clock, Accuracy(0.0, 0.0, 0, 0), None).y
        self.initial: Real = y[plant.nq + plant.nu : -1]
        """(X,) initial states of the controllers."""
        self.state_names = feedback.state_names
        project(start.t, y, feedback.running)  # also finds the independent rows of closures

    def at(self, state: State, x: Real, model: Callable[[Equations, State], LinearModel]) -> AtState:
        """The linearisation about a state of the motion and the states x (X,) of the controllers."""
        plant, feedback = self._plant, self._feedback
        laws = _Laws(feedback, state.t, np.concatenate([state.q, state.u, x, [0.0]]))
        equations = equations_of(plant)
        of_motion = model(equations, state)
        n, drives, states, sensors = len(of_motion.rates), len(feedback.driven), len(x), laws.sensors
        G, L = laws.derivative[:drives, :sensors], laws.derivative[drives:, :sensors]
        G_x, L_x = laws.derivative[:drives, sensors:], laws.derivative[drives:, sensors:]
        rows = slice(len(of_motion.outputs) - sensors, None)  # sensors come last
        C, E = of_motion.C[rows], of_motion.D[rows]
        moved, said = _effect(equations, state, feedback.driven)
        pushed = np.vstack([np.zeros((n, drives)), moved[equations.variations(state).chosen]])
        A = np.block([[of_motion.A + pushed @ G @ C, pushed @ G_x], [L @ (C + said @ G @ C), L_x + L @ said @ G_x]])
        outputs = np.hstack([of_motion.C, np.zeros((len(of_motion.C), states))])
        outputs[rows] += said @ np.hstack([G @ C, G_x])
        return AtState(A, np.vstack([of_motion.B, L @ E]), outputs, laws.rates, of_motion)


class _Start(NamedTuple):
    """The state at which controllers start."""

    state: State
    controllers: None = None

    @property
    def y(self) -> Real:
        return np.concatenate([self.state.q, self.state.u, [0.0]])


class _Laws:
    """Continuous controllers at y = [q, u, x, work]: drive values and rates of x, with their derivatives.

    `derivative` (drives+X,S+X) is by sensor signals and x. DynamicsError where accelerations do not exist.
    """

    def __init__(self, feedback: Feedback, t: float, y: Real) -> None:
        self._feedback, self._loop, self._t = feedback, feedback.running, t
        self._raise(look(t, y, self._loop.signal.copy(), self._loop))
        signals, places = self._loop.signal, feedback.continuous_states
        self.sensors: int = int(np.sum(self._loop.sensor["width"]))
        self.rates: Real = self._respond()[len(feedback.driven) :]
        columns = [self._difference(signals, i) for i in range(self.sensors)]
        columns += [self._difference(self._loop.state, i) for i in places]
        self.derivative = np.column_stack(columns) if columns else np.zeros((len(feedback.driven) + len(places), 0))
        self._respond()  # restore the controller outputs at the state

    def _difference(self, array: Real, i: int) -> Real:
        value, h = array[i], STEP * max(1.0, abs(array[i]))
        found = []
        for k in (-2, -1, 1, 2):
            array[i] = value + k * h
            found.append(self._respond())
        array[i] = value
        return np.asarray((found[0] - found[3] + 8.0 * (found[2] - found[1])) / (12.0 * h), float)

    def _respond(self) -> Real:
        """Drive values, then the rates of x."""
        self._raise(respond(self._t, self._loop))
        driven = [self._loop.function["data"][f, 0] for f in self._feedback.driven]
        return np.array([*driven, *self._loop.change[self._feedback.continuous_states]])

    def _raise(self, status: int) -> None:
        self._feedback.raise_trouble()
        if status != OK:
            raise DynamicsError(Status(status).advice.format(body="at this state"))


def _refuse(system: System) -> None:
    sampled = [each.name for each in system.scene.controllers if each.period_s is not None]
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
