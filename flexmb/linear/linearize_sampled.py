"""Linear models of scenes with sampled controllers, exact over their common period."""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import replace

import numpy as np

from flexmb.control.feedback import Feedback
from flexmb.control.held import holding, is_added, own_name, resting_alike, resting_states
from flexmb.control.loop import project
from flexmb.control.loop_run import FreshStart
from flexmb.control.sampled_laws import LawsAtState, sampled_laws
from flexmb.linear.controlled_motion import ControlledMotion
from flexmb.linear.equations import built
from flexmb.linear.equilibrium import found_equilibrium
from flexmb.linear.linear_model import LinearModel
from flexmb.linear.linearize import linearize
from flexmb.linear.newton import EquilibriumError
from flexmb.linear.sampled_loop import BetweenInstants, Cut, LiftedLoop
from flexmb.linear.sampled_model import SampledModel
from flexmb.linear.sensed import readable, sensor_names
from flexmb.scene.schema import Scene
from flexmb.system import algorithms
from flexmb.system.compile import assembled
from flexmb.system.kinks import NotDifferentiableError, meets
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.state import State
from flexmb.typing import Flags, Index, Real

STEPS = 8
CONVERGED = 1e-10
NOTHING = 2.0**-46  # of the largest entry of a row: rounding


def linearize_sampled(
    system: System | Scene, period: float | None = None, state: State | None = None, *, held: bool = False
) -> SampledModel:
    """The exact discrete model of a scene with sampled controllers, over the period (s) after which all repeat.

    Between instants it is the linear model of `linearize`, with its exact derivatives, moved by matrix exponentials; at
    instants the controllers act as in a run, with offsets and delays. A multiple of the common period may be asked for.
    Without sampled controllers it is the model whose loads are held for a `period`.

    state: default: where the loop rests, found from the initial state as `equilibrium` does, controllers' own states
    included, with all functions of time held at t = 0. About a given state the controllers have their initial states,
    put out what they give there (a `Pid` without a difference of errors), and functions of time are held only with
    `held`. If it is no equilibrium, `SampledModel.rates` has its accelerations.

    Warns (`SceneWarning`) as `linearize` does. Raises what `linearize` and `equilibrium` raise. Also raises
    `NotDifferentiableError` (a DynamicsError) where a sampled controller is exactly at a limit, its law has no
    derivative, or an event's signal is at its level; ValueError for periods that never repeat together, or a period
    that is no multiple of the common one;
    NotImplementedError where outputs depend on themselves through loads and do not settle, and without a state for
    sampled laws of users that have states, and a continuous `Pid` that may rest at a limit.
    """
    if not isinstance(system, System | Scene):
        raise TypeError(f"a System or a Scene is needed, not {type(system).__name__}")
    if period is not None and not arguments.number("period", period) > 0.0:
        raise ValueError(f"period: {period:g} s is no period: give a positive one, or leave it out")
    plant = copy(built(system))
    states: dict[str, Real] = {}
    if state is None:
        state, states = _rest(plant.scene)
        held = True
    plant.layout.entering(state)
    if plant.constraints:
        state = plant.admissible(state, "state")
    route = plant.route()
    feedback = Feedback(plant, algorithms.chosen("articulated"), route, route.tables())
    y = feedback.begin_at(FreshStart(state), {})
    if states:
        of = [states[each.name] for each in plant.scene.controllers if each.period_s is None]
        y[plant.nq + plant.nu : -1] = np.concatenate([np.zeros(0), *of])
    project(state.t, y.copy(), feedback.running)  # finds the independent rows of closures
    laws = sampled_laws(feedback, state.t, y, states)
    _refuse_events(plant.scene, feedback, laws)
    outputs = {law.name: law.outputs for law in laws.laws}
    between = linearize(assembled(holding(plant.scene, outputs, states)), state, held=held)
    between = _without_integrals(between)
    return _model(plant, feedback, laws, between, None if period is None else float(period))


def _rest(scene: Scene) -> tuple[State, dict[str, Real]]:
    """The state where the loop rests, and the states of its controllers by name."""
    system = assembled(resting_alike(scene))
    state = found_equilibrium(system, None)[0]
    motion = ControlledMotion(system)
    x, own = _resting(motion, state), dict[str, Real]()
    owners = [name.rpartition(".")[0] for name in motion.state_names]
    for controller in scene.controllers:
        mine = x[[i for i, owner in enumerate(owners) if owner == controller.name]]
        own[controller.name] = resting_states(controller, mine)
    return State(state.q, state.u, state.t, state.layout), own


def _resting(motion: ControlledMotion, state: State) -> Real:
    """States (X,) of continuous controllers with which the motion rests at a state, by Newton's method."""
    x = motion.initial_states(state)
    for _ in range(STEPS):
        at = motion.acceleration_derivatives(state, x)
        left = np.r_[at.accelerations, at.rates]
        slope = np.vstack([at.of_accelerations.by_states, at.of_rates.by_states])
        step = -np.linalg.lstsq(slope, left, rcond=1e-12)[0] if len(x) else np.zeros(0)
        if np.max(np.abs(step), initial=0.0) <= CONVERGED * (1.0 + np.max(np.abs(x), initial=0.0)):
            return np.asarray(x + step)
        x = x + step
    raise EquilibriumError("no states of the controllers with which the loop rests were found: give a state")


def _without_integrals(model: LinearModel) -> LinearModel:
    """The model between instants without the states of integrals that `holding` has added, which do not change."""
    keep = [i for i, (name, _) in enumerate(model.states) if not is_added(name)]
    return replace(
        model, states=tuple((own_name(model.states[i][0]), model.states[i][1]) for i in keep),
        A=model.A[np.ix_(keep, keep)], B=model.B[keep], C=model.C[:, keep],
    )  # fmt: skip


def _refuse_events(scene: Scene, feedback: Feedback, laws: LawsAtState) -> None:
    """NotDifferentiableError for an event that watches a signal which is just at its level: small motions meet it."""
    signals = {sensor.name for sensor in scene.sensors} | {controller.name for controller in scene.controllers}
    for event in scene.events:
        if event.watch.partition("[")[0] in signals:
            value = float(laws.signals[feedback.place_of(event.watch)])
            if meets(value, event.level, abs(event.level)):
                raise NotDifferentiableError(
                    f'event "{event.name}" watches "{event.watch}", which is at its level at this state: what follows '
                    "is not linear. Move the state or the level, or leave the event out: "
                    "msgspec.structs.replace(scene, events=())"
                )


def _model(
    plant: System, feedback: Feedback, laws: LawsAtState, between: LinearModel, period: float | None
) -> SampledModel:
    controllers, sensors = feedback.controllers, len([*sensor_names(plant)])
    names = [name for name, _ in between.states]
    places = {law.name: [names.index(f"{law.name}.state[{i}]") for i in range(len(law.outputs))] for law in laws.laws}
    motion = 2 * len(between.rates)
    held = {i for each in places.values() for i in each}
    continuous = [i for i in range(motion, len(names)) if i not in held]
    of_laws = (of @ _picked(law.reads, sensors) for law in laws.laws for of in (law.B, law.D))
    read = np.vstack([laws.by_sensor[:, :sensors], *of_laws])
    rows = slice(len(between.outputs) - sensors, None)
    by_state, by_load = readable(read, between.C[rows]), readable(read, between.D[rows])
    signals = np.zeros((len(laws.signals), len(names)))
    loads = np.zeros((len(laws.signals), len(between.inputs)))
    signals[:sensors], loads[:sensors] = by_state, by_load
    signals += laws.by_sensor @ by_state
    loads += laws.by_sensor @ by_load
    signals[:, continuous] += laws.by_state
    signals[:, [i for law in laws.laws for i in places[law.name]]] += laws.by_held
    for law in laws.laws:
        signals[law.signals] = np.eye(len(names))[places[law.name]]
    flow = BetweenInstants(between.A, between.B, signals, loads, places, between.C, between.D)
    loop = LiftedLoop(controllers, flow, {law.name: law for law in laws.laws}, sensors)
    common = loop.period(period)
    lifted = loop.lifted(common)
    keep = np.flatnonzero(lifted.read)
    units = dict(sensor_names(plant))
    renamed = {i: f"{law.name}.held[{j}]" for law in laws.laws for j, i in enumerate(places[law.name])}
    every = [(renamed.get(i, name), unit) for i, (name, unit) in enumerate(between.states)]
    every += [(name, "") for name in loop.state_names(common)]
    states = tuple(every[i] for i in keep)
    said = [name for controller in controllers for name in _numbered(controller.name, feedback)]
    return SampledModel(
        scene=plant.scene.name, state=between.state, period=common, states=states,
        inputs=(*between.inputs, *units.items()), outputs=(*between.outputs, *((name, "") for name in said)),
        A=lifted.A[np.ix_(keep, keep)], B=lifted.B[keep], C=lifted.C[:, keep], D=lifted.D,
        mass=between.mass, rates=between.rates,
        free=tuple(names[i] for i in np.flatnonzero(_free(flow, laws, motion))),
        saturated=tuple(law.name for law in laws.laws if law.saturated),
        loop=loop, loop_signals=dict(_cuts(feedback, laws, list(units), flow)),
    )  # fmt: skip


def _picked(places: Index, count: int) -> Real:
    """(len(places), count) that picks those of the first `count` signals that are at these places."""
    return np.eye(max(count, int(np.max(places, initial=-1)) + 1))[places][:, :count]


def _numbered(name: str, feedback: Feedback) -> list[str]:
    """Names of a controller's outputs, "law", or "law[0]" if there are several."""
    place = feedback.names[name]
    count = place.stop - place.start
    return [name] if count == 1 else [f"{name}[{i}]" for i in range(count)]


def _cuts(
    feedback: Feedback, laws: LawsAtState, sensors: list[str], flow: BetweenInstants
) -> Iterator[tuple[str, Cut]]:  # fmt: skip
    """Where the loop can be opened, by name: at outputs of sampled controllers, and at sensors that only these read and
    that the motion changes."""
    for law in laws.laws:
        for name, signal in zip(_numbered(law.name, feedback), law.signals, strict=True):
            yield name, Cut(int(signal), False)
    made = feedback.running
    read = {int(i) for law in laws.laws for i in law.reads}
    for row in made.controller:
        if not row["sampled"]:
            read -= set(made.wire[row["input"] : row["input"] + row["inputs"]].tolist())
    for i in sorted(read):
        if i < len(sensors) and np.any(flow.signals[i] != 0.0):
            yield sensors[i], Cut(i, True)


def _free(flow: BetweenInstants, laws: LawsAtState, motion: int) -> Flags:
    """Which displacements and speeds drift (z,): nothing but others of them depends on them, within rounding."""
    rows = np.vstack([flow.A, *(law.B @ flow.signals[law.reads] for law in laws.laws),
                      *(law.D @ flow.signals[law.reads] for law in laws.laws)])  # fmt: skip
    depends = np.abs(rows) > NOTHING * np.max(np.abs(rows), axis=1, initial=0.0, keepdims=True)
    free = np.zeros(len(flow.A), bool)
    while True:
        left = np.r_[~free, np.ones(len(rows) - len(free), bool)]
        more = ~free & ~np.any(depends[left], axis=0)
        more[motion:] = False
        if not more.any():
            return free
        free |= more
