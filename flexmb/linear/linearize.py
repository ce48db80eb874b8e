"""Linear models from systems: matrices, inputs and outputs with names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.linear.equations import built, entering
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.variations import Equations, Variations
from flexmb.scene.schema import Scene
from flexmb.system.pushforward import Directions, GivenMotion
from flexmb.system.system import System
from flexmb.system.watches import WatchedStates, of_states, warn
from flexmb.tables.state import State, finite_result
from flexmb.typing import Real


def linearize(system: System | Scene, state: State | None = None, *, held: bool = False) -> LinearModel:
    """The linear model about a state (default: the initial one), by exact derivatives.

    Prescribed coordinates follow their functions of time; with `held`, all functions keep their values at the state's
    time, as in `equilibrium`. If the state is no equilibrium, `LinearModel.rates` has its accelerations. For a closed
    chain the states are the independent coordinates; the dependent ones are among the outputs. For a scene with
    controllers it is the model of the closed loop about the controllers' initial states, which come last in x. Sensor
    signals are among the outputs: "gyro[0]", or "angle" for a single number; loads and accelerations have direct
    feedthrough, D. Warns (`SceneWarning`) as `simulate` does of levels, points and polynomials. Raises DynamicsError
    where the accelerations do not exist, `NotDifferentiableError` (one of them) where a controller is exactly at a
    limit, or a connector just at a stop or slack, NotImplementedError for sampled controllers and closures on bodies of
    level "ruthless", ValueError or TypeError for a state that does not belong to this system or leaves closures open.
    """
    model, seen = seen_model(system, state, held)
    warn(seen)
    return model


def seen_model(system: System | Scene, state: State | None, held: bool) -> tuple[LinearModel, WatchedStates]:
    """The model of `linearize`, and what watches of accuracy look at."""
    if isinstance(system, Scene) and system.controllers:
        system = built(system)
    if isinstance(system, System) and system.scene.controllers:
        from flexmb.linear.closed_loop import closed_model, continuous_loop  # imported only for scenes with controllers

        loop = continuous_loop(system)
        state = loop.entering(system.initial_state if state is None else state)
        seen = list[tuple[Equations, State]]()

        def of_motion(equations: Equations, at: State) -> LinearModel:
            equations = equations.held(at.t) if held else equations
            seen.append((equations, equations.on_functions(at)))
            return linear_model(*seen[-1])

        model, _ = closed_model(loop, state, None, of_motion)
        return model, looked_at(seen)
    equations, state = entering(system, state)
    equations = equations.held(state.t) if held else equations
    if held or equations.system.constraints is None:  # states that enter for a closed chain are on its functions
        state = equations.on_functions(state)
    return linear_model(equations, state), looked_at([(equations, state)])


def looked_at(states: Sequence[tuple[Equations, State]]) -> WatchedStates:
    """States of one system as watches of accuracy see them, each with the equations that it moves by."""
    return of_states(states[0][0].system, [state for _, state in states], lambda n: states[n][0].turns(states[n][1]))


def held_model(equations: Equations, state: State) -> LinearModel:
    """The model with all functions of time held at their values at the state's time."""
    equations = equations.held(state.t)
    return linear_model(equations, equations.on_functions(state))


def linear_model(equations: Equations, state: State) -> LinearModel:
    """The model of equations whose functions of time are already held or replaced as wanted, at a state on these."""
    system, labels = equations.system, equations.labels
    system.refuse_corners(*system.layout.entering(state))
    at, n, free = equations.variations(state), equations.freedom, equations.free
    A, driven, markers = finite_result(at.A, state.t), labels.driven, labels.markers
    for part in (at.drift, at.rates):
        finite_result(part, state.t)
    states, dependent, places = equations.state_names(at.chosen)
    B, few, all_but_markers = np.zeros((2 * n, len(driven))), len(states), len(states) + len(dependent)
    B[n:] = at.free.of_accelerations.by_force[free[at.chosen]][:, free[driven]]
    C = np.zeros((all_but_markers + len(markers), 2 * n))
    C.ravel()[: few * few : few + 1] = 1.0
    C[few:all_but_markers] = at.by_chosen[places]
    C[all_but_markers:] = _markers(equations, at)
    D = np.zeros((len(C), len(driven)))
    if system.scene.sensors:
        from flexmb.linear.sensed import of_sensors  # imported only for scenes with sensors

        sensors = of_sensors(equations, at)
        C, D = np.vstack([C, sensors.by_state]), np.vstack([D, sensors.by_force[:, driven]])
        markers = (*markers, *sensors.names)
    return LinearModel(
        scene=system.scene.name, state=state, states=states, inputs=labels.inputs,
        outputs=(*states, *dependent, *markers), A=A, B=B, C=C, D=D,
        mass=at.mass, motion=at.motion, rates=at.rates, drift=at.drift,
    )  # fmt: skip


def _markers(equations: Equations, at: Variations) -> Real:
    """(6 K, 2f) displacement and rotation of markers by xi, from velocities, which are linear in u and do not depend on
    accelerations and loads."""
    system, state, n = equations.system, at.state, equations.freedom
    rows = np.zeros((len(equations.labels.markers), 2 * n))
    if len(rows):
        speeds, nu, loads = np.zeros((system.nq + system.nu, n)), system.nu, len(at.free.rows.loads)
        speeds[system.nq + equations.free] = at.basis
        push, motion = equations.pushforward, GivenMotion(state.t, state.kernel_y, np.zeros(nu), np.zeros(loads))
        still = Directions(speeds, np.zeros((nu, n)), np.zeros((loads, n)), np.zeros(n))
        place, shape = system.observation.columns["markers"]
        change = push.derivatives(motion, still, lambda lanes: push.out.every[place, lanes]).reshape(*shape, n)
        rows[:, :n] = np.concatenate([change[:, 15:18], change[:, 12:15]], axis=1).reshape(len(rows), n)
    return rows
