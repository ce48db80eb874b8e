"""The linear model of a scene with continuous controllers: their states behind those of the motion.

What the controllers see and drive is linearised by differences of fourth order, exact but for rounding where sensors
and laws are linear; the motion itself by exact derivatives, under the torques that the controllers ask for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.control.loop import project, rhs
from flexmb.integrate.problem import Accuracy, Clock
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.variations import Equations, equations_of
from flexmb.motion.retraction import move
from flexmb.scene.functions import Constant
from flexmb.system import algorithms
from flexmb.system.closed import ClosedSystem
from flexmb.system.tree_system import System
from flexmb.tables.state import DynamicsError, State
from flexmb.tables.status import OK, Status
from flexmb.typing import Real

LARGE = 2.0**20
"""Change of a value whose effect is linear: beside it the rounding of all others is nothing."""
REMEDY = "linearise flexmb.open_loop(scene), and close the loop on that model"
STEP = 1e-3
"""Of differences, in SI units or relative: its fourth power and rounding over it are both 1e-13."""


def closed_loop(system: System, state: State, model: Callable[[Equations, State], LinearModel]) -> LinearModel:
    """About a state, and the controllers' initial states; `model` makes the linear model of a motion.

    NotImplementedError for controllers that are sampled or read what depends on forces of the same instant.
    """
    if isinstance(system, ClosedSystem):
        state = system._admissible(*system.layout.entering(state))
    loop = ClosedLoop(system, state)
    found = loop.at(state, loop.initial, model)
    of_motion, states = found.of_motion, len(loop.initial)
    return replace(
        of_motion,
        states=(*of_motion.states, *((name, "") for name in loop.state_names)),
        A=found.A,
        B=np.vstack([of_motion.B, np.zeros((states, len(of_motion.inputs)))]),
        C=np.hstack([of_motion.C, np.zeros((len(of_motion.outputs), states))]),
    )


class AtState(NamedTuple):
    """A closed loop linearised: A (2f+X,2f+X) of [xi; du; dx]; rates (X,) of x; the model of the motion by itself."""

    A: Real
    rates: Real
    of_motion: LinearModel


class ClosedLoop:
    """A system with its controllers, continuous ones, at any of their states."""

    def __init__(self, system: System, start: State) -> None:
        _refuse(system)
        self._plant = plant = system._anew()
        chosen, route = algorithms.chosen("articulated"), plant.route()
        self._feedback = feedback = Feedback(plant, chosen, route, route.tables())
        if feedback.reads_at_once:
            raise NotImplementedError(f"a controller reads an acceleration or a load: {REMEDY}")
        clock = Clock(np.array([start.t, start.t + 1.0]), np.array([start.t + 1.0]))
        y = feedback.begin(_Start(start), clock, Accuracy(0.0, 0.0, 0, 0), None).y
        self.initial: Real = y[plant.nq + plant.nu : -1]
        """(X,) states of controllers at the start."""
        self.state_names = feedback.state_names
        project(start.t, y, feedback.running)  # which finds the independent rows of closures

    def at(self, state: State, x: Real, model: Callable[[Equations, State], LinearModel]) -> AtState:
        """Linearised about a state of the motion and x (X,) of the controllers."""
        plant, feedback = self._plant, self._feedback
        y = np.concatenate([state.q, state.u, x, [0.0]])
        equations = equations_of(plant)
        seen = _Seen(feedback, state.t, plant.nq + plant.nu)
        derivative = np.column_stack([
            (at[0] - at[3] + 8.0 * (at[2] - at[1])) / (12.0 * size)
            for move_by, size in _variations(plant, y, equations, state)
            for at in [[seen(move_by(k * size)) for k in (-2, -1, 1, 2)]]
        ])  # fmt: skip
        now = seen(y)  # and the controllers say again what they say at the state
        of_motion, at = model(equations, state), equations.variations(state)
        n, drives, states = equations.freedom, len(now) - len(x), len(x)
        by_independent = np.eye(len(at.by_chosen) + states, 2 * n + states, 2 * n - len(at.by_chosen))
        by_independent[: len(at.by_chosen), : 2 * n] = at.by_chosen
        derivative = derivative @ by_independent
        A = np.zeros((2 * n + states, 2 * n + states))
        A[: 2 * n, : 2 * n] = of_motion.A
        A[n : 2 * n] += _effect(equations, state, feedback.driven)[at.chosen] @ derivative[:drives]
        A[2 * n :] = derivative[drives:]
        return AtState(A, now[drives:], of_motion)


class _Start(NamedTuple):
    """A state, at which controllers begin."""

    state: State
    controllers: None = None

    @property
    def y(self) -> Real:
        return np.concatenate([self.state.q, self.state.u, [0.0]])


class _Seen:
    """What is driven at y = [q, u, x, work], and the rates of x, as one row."""

    def __init__(self, feedback: Feedback, t: float, of_motion: int) -> None:
        self._feedback, self._t, self._of_motion = feedback, t, of_motion

    def __call__(self, y: Real) -> Real:
        """DynamicsError where there are no accelerations."""
        loop, slope = self._feedback.running, np.empty(len(y))
        status = rhs(self._t, y, slope, loop, loop)
        self._feedback.raise_trouble()
        if status != OK:
            raise DynamicsError(Status(status).advice.format(body="at this state"))
        driven = [loop.function["data"][f, 0] for f in self._feedback.driven]
        return np.array([*driven, *slope[self._of_motion : -1]])


def _refuse(system: System) -> None:
    sampled = [each.name for each in system.scene.controllers if each.period_s is not None]
    if sampled:
        raise NotImplementedError(
            f'controller "{sampled[0]}" is sampled: a closed loop with instants has no linear model of this kind; '
            f"{REMEDY}"
        )


def _variations(
    plant: System, y: Real, equations: Equations, state: State
) -> Iterator[tuple[Callable[[float], Real], float]]:
    """For each displacement, speed and controller's state, y as a function of its change, and the step of differences.
    """
    nq, nu = plant.nq, plant.nu

    def displaced(j: int, size: float) -> Real:
        result, increment = y.copy(), np.zeros(nu)
        increment[j] = size
        move(y, increment, result, plant.constants)
        return result

    def changed(i: int, size: float) -> Real:
        result = y.copy()
        result[i] += size
        return result

    for j in equations.free:
        yield partial(displaced, j), STEP
    for j in equations.free:
        yield partial(changed, nq + j), STEP * max(1.0, abs(state.u[j]))
    for i in range(nq + nu, len(y) - 1):
        yield partial(changed, i), STEP * max(1.0, abs(y[i]))


def _effect(equations: Equations, state: State, driven: Iterable[int]) -> Real:
    """(n,D) accelerations of the free speeds by each value that is driven, in which they are linear."""
    held = equations.constant_functions(state.t)

    def rates(f: int, change: float) -> Real:
        changed = Constant(value=held[f].value + change)
        return equations.with_functions([*held[:f], changed, *held[f + 1 :]]).rates(state)

    columns = [(rates(f, LARGE) - rates(f, 0.0)) / LARGE for f in driven]
    return np.column_stack(columns) if columns else np.zeros((len(equations.free), 0))
