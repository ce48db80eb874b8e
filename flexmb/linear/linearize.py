"""Linear models from systems: matrices, inputs and outputs with names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flexmb.linear.equations import built, entering
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.variations import Equations, Variations
from flexmb.scene.schema import Scene
from flexmb.system.pushforward import Directions
from flexmb.system.system import System
from flexmb.system.watches import WatchedStates, of_states, warn
from flexmb.tables.state import DynamicsError, State
from flexmb.typing import Real

_ROTATION = tuple((f"rotation.{axis}", "rad") for axis in "xyz")
_POSITION = tuple((f"position.{axis}", "m") for axis in "xyz")
_FORCE = {"rad/s": "N m", "m/s": "N", "1/s": "1"}


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
    if isinstance(system, Scene) and system.controllers:
        system = built(system)
    if isinstance(system, System) and system.scene.controllers:
        from flexmb.linear.closed_loop import closed_loop  # imported only for scenes with controllers

        state = system.initial_state if state is None else state
        system.layout.entering(state)
        seen = list[tuple[Equations, State]]()

        def of_motion(equations: Equations, at: State) -> LinearModel:
            equations = equations.held(at.t) if held else equations
            seen.append((equations, equations.on_functions(at)))
            return linear_model(*seen[-1])

        model = closed_loop(system, state, of_motion)
        warn(looked_at(seen))
        return model
    equations, state = entering(system, state)
    equations = equations.held(state.t) if held else equations
    state = equations.on_functions(state)
    warn(looked_at([(equations, state)]))
    return linear_model(equations, state)


def looked_at(states: Sequence[tuple[Equations, State]]) -> WatchedStates:
    """States of one system as watches of accuracy see them, each with the equations that it moves by."""
    return of_states(states[0][0].system, [state for _, state in states], lambda n: states[n][0].turns(states[n][1]))


def held_model(equations: Equations, state: State) -> LinearModel:
    """The model with all functions of time held at their values at the state's time."""
    equations = equations.held(state.t)
    return linear_model(equations, equations.on_functions(state))


def linear_model(equations: Equations, state: State) -> LinearModel:
    """The model of equations whose functions of time are already held or replaced as wanted, at a state on these."""
    system, free = equations.system, equations.free
    system.refuse_corners(*system.layout.entering(state))
    at, n = equations.variations(state), equations.freedom
    names, units = displacement_names(equations)
    speeds = [system.state_names[1][j] for j in free]
    driven = _driven(equations)
    B = np.zeros((2 * n, len(driven)))
    B[n:] = np.linalg.solve(at.mass, at.basis[driven].T)
    markers, seen = _markers(equations, at)
    everything = [*zip(names, units, strict=True), *speeds]
    chosen = np.r_[at.chosen, len(free) + at.chosen]
    dependent = np.delete(np.arange(2 * len(free)), chosen)
    states = tuple(everything[i] for i in chosen)
    C = np.vstack([np.eye(2 * n), at.by_chosen[dependent], seen])
    D = np.zeros((len(C), len(driven)))
    if system.scene.sensors:
        from flexmb.linear.sensed import of_sensors  # imported only for scenes with sensors

        sensors = of_sensors(equations, at)
        C, D = np.vstack([C, sensors.by_state]), np.vstack([D, sensors.by_force[:, driven]])
        markers += sensors.names
    if not all(np.isfinite(part).all() for part in (at.A, at.drift, at.rates)):
        raise DynamicsError("derivatives are not finite: coordinates or speeds are so large that products overflow")
    return LinearModel(
        scene=system.scene.name, state=state, states=states,
        inputs=tuple((names[i], _FORCE[speeds[i][1]]) for i in driven),
        outputs=(*states, *(everything[i] for i in dependent), *markers),
        A=at.A, B=B, C=C, D=D,
        mass=at.mass, motion=at.motion, rates=at.rates, drift=at.drift,
    )  # fmt: skip


def displacement_names(equations: Equations) -> tuple[list[str], list[str]]:
    """Names and units of xi: those of the coordinates, "<hinge>.rotation.x" and "<hinge>.position.x" of quaternions."""
    system = equations.system
    named = [("", "")] * system.nu
    coordinates = system.state_names[0]
    for j, speed in enumerate(equations.constants.speed):
        if speed["coordinate"] >= 0:
            named[j] = coordinates[speed["coordinate"]]
    for name, body in zip(system.body_names, equations.constants.body, strict=True):
        modes = slice(int(body["etad_index"]), int(body["etad_index"] + body["modes"]))
        named[modes] = coordinates[int(body["eta_index"]) : int(body["eta_index"] + body["modes"])]
        if body["quaternion"] >= 0:
            hinge = next(hinge.name for hinge in system.scene.hinges if hinge.child == name)
            labels = _ROTATION if body["quaternion"] == body["q_index"] else _ROTATION + _POSITION
            j = int(body["u_index"])
            named[j : j + len(labels)] = [(f"{hinge}.{label}", unit) for label, unit in labels]
    chosen = [named[j] for j in equations.free]
    return [name for name, _ in chosen], [unit for _, unit in chosen]


def _driven(equations: Equations) -> list[int]:
    """Indices among the free speeds of those that a motor can drive: all but the modal ones."""
    modal = np.zeros(equations.system.nu, bool)
    for body in equations.constants.body:
        modal[int(body["etad_index"]) : int(body["etad_index"] + body["modes"])] = True
    return np.flatnonzero(~modal[equations.free]).tolist()


def _markers(equations: Equations, at: Variations) -> tuple[list[tuple[str, str]], Real]:
    """Names and rows (6 K, 2f): displacement and rotation of markers by xi, from velocities, which are linear in u."""
    system, state, n = equations.system, at.state, equations.freedom
    labels = [*zip("xyz", "mmm", strict=True), *_ROTATION]
    names = [(f"{marker.name}.{label}", unit) for marker in system.scene.markers for label, unit in labels]
    rows = np.zeros((len(names), 2 * n))
    if names:
        speeds = np.zeros((system.nq + system.nu, n))
        speeds[system.nq + equations.free] = at.basis
        push, motion = equations.pushforward, equations.motion(state)
        still = Directions(speeds, np.zeros((system.nu, n)), np.zeros((len(motion.loads), n)), np.zeros(n))
        place, shape = system.observation.columns["markers"]
        change = push.derivatives(motion, still, push.row)[place].reshape(*shape, n)
        rows[:, :n] = np.concatenate([change[:, 15:18], change[:, 12:15]], axis=1).reshape(len(names), n)
    return names, rows
