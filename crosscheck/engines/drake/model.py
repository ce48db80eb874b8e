"""One scene compiled for Drake: evaluate at t = 0, or integrate with any of Drake's schemes for continuous systems."""

from __future__ import annotations

import time
from itertools import pairwise

import numpy as np
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig, SimulatorStatus
from pydrake.systems.framework import Context, Diagram, DiagramBuilder, EventStatus

from crosscheck.engines.contract import Effort, Run, Snapshot, Trajectory
from crosscheck.engines.drake.actions import DrakeActions, DrakeLoads, Drives, JointActions
from crosscheck.engines.drake.linear import linearised
from crosscheck.engines.drake.observer import DrakeObserver
from crosscheck.engines.drake.tree import DrakeState, build_tree, initial_state, place, recentred
from crosscheck.engines.functions_of_time import breaks_between, scene_functions
from crosscheck.engines.linear.outputs import outputs
from crosscheck.engines.links import links
from crosscheck.engines.rigid_tree import TreeLoads
from crosscheck.engines.trajectories import stack
from flexmb.scene.schema import Scene
from flexmb.typing import Real

_STEEP = 0.8  # pitch (rad) of a ball joint beyond which its angles restart at zero; they are singular at pi/2


class DrakeModel:
    def __init__(self, scene: Scene) -> None:
        chain = links(scene)
        self._tree = build_tree(scene, chain, ballasted=True)
        self._drives = Drives(self._tree)
        given = TreeLoads(scene, chain, self._tree.slots)
        joints, loads = JointActions(self._tree, given), DrakeLoads(self._tree, given)
        self._actions = DrakeActions(self._tree, joints, self._drives, loads)
        self._diagram = self._connected(bool(joints or self._drives), bool(loads))
        self._observer = DrakeObserver(build_tree(scene, chain, ballasted=False), scene)
        self._functions = scene_functions(scene)
        self._pitches = [slot.q + 1 for slot in self._tree.balls]
        self._linear = linearised(self._tree, scene)

    def warm_up(self) -> None:
        """Nothing is compiled; touch the code once so that first-call costs are not timed."""
        self.evaluate()

    def evaluate(self) -> Snapshot:
        return self._observed(np.zeros(1), [initial_state(self._tree)])[0]

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        start = time.perf_counter()
        with np.errstate(over="ignore", invalid="ignore"):  # divergence is a status
            states, evaluations, message = self._integrate(run.times, effort)
        wall = time.perf_counter() - start
        samples = self._observed(run.times[: len(states)], states)
        at = self._linear
        matrices = () if at is None else (at.at(t, state) for t, state in zip(run.times, states, strict=False))
        linear = outputs(run.linear if at is not None else (), matrices)
        return stack(run.times, samples, message=message, wall_s=wall, evaluations=evaluations, linear=linear)

    def _connected(self, has_forces: bool, has_loads: bool) -> Diagram:
        """The plant with the actions that this scene needs: without any Drake integrates in C++ alone."""
        builder = DiagramBuilder()
        plant, actions = self._tree.plant, self._actions
        builder.AddSystem(plant)
        if has_forces or has_loads:
            builder.AddSystem(actions)
            builder.Connect(plant.get_state_output_port(), actions.state)
            builder.Connect(plant.get_body_poses_output_port(), actions.poses)
            builder.Connect(plant.get_body_spatial_velocities_output_port(), actions.speeds)
        if has_forces:
            builder.Connect(actions.forces, plant.get_applied_generalized_force_input_port())
        if has_loads:
            builder.Connect(actions.wrenches, plant.get_applied_spatial_force_input_port())
        return builder.Build()

    def _observed(self, times: Real, states: list[DrakeState]) -> list[Snapshot]:
        """Snapshots of states; where a function of time jumps, its limit from the right is used."""
        self._actions.before_end = np.inf
        context = self._diagram.CreateDefaultContext()
        own = self._tree.plant.GetMyContextFromRoot(context)
        snapshots = []
        for t, state in zip(times, states, strict=True):
            self._put(context, t, state)
            acceleration = self._tree.plant.get_generalized_acceleration_output_port().Eval(own)
            snapshots.append(self._observer.observe(t, state, acceleration))
        return snapshots

    def _put(self, context: Context, t: float, state: DrakeState) -> None:
        """Set the state of a context of the diagram; setting the time also invalidates cached actions."""
        self._actions.turned = state.turned
        context.SetTime(t)
        place(self._tree, self._tree.plant.GetMyMutableContextFromRoot(context), state)

    def _read(self, context: Context, turned: tuple[Real, ...]) -> DrakeState:
        plant = self._tree.plant
        own = plant.GetMyContextFromRoot(context)
        return DrakeState(plant.GetPositions(own).copy(), plant.GetVelocities(own).copy(), turned)

    def _integrate(self, times: Real, effort: Effort) -> tuple[list[DrakeState], int, str]:
        """States at the sample times reached, evaluations of the right-hand side, and why it stopped early.

        Sample times and breaks of the functions of time divide the run into intervals; at the start of each the
        prescribed coordinates are set to their functions.
        """
        simulator = Simulator(self._diagram)
        ApplySimulatorConfig(_settings(effort, times), simulator)
        context, integrator = simulator.get_mutable_context(), simulator.get_integrator()
        if self._pitches:
            simulator.set_monitor(self._too_steep)
        wanted = set(times.tolist())
        ends = sorted(wanted | set(breaks_between(self._functions, times[0], times[-1])))
        state = initial_state(self._tree)
        states = [state]
        for begin, end in pairwise(ends):
            self._actions.before_end = np.nextafter(end, begin)
            self._drives.follow(begin, state.q, state.v)
            self._put(context, begin, state)
            state, message = self._stretch(simulator, end, state.turned)
            if message:
                return states, integrator.get_num_derivative_evaluations(), f"stopped after t = {begin:g} s: {message}"
            if end in wanted:
                states.append(DrakeState(state.q.copy(), state.v.copy(), state.turned))
        return states, integrator.get_num_derivative_evaluations(), ""

    def _stretch(self, simulator: Simulator, end: float, turned: tuple[Real, ...]) -> tuple[DrakeState, str]:
        """Advance to `end`, restarting the angles of steep ball joints on the way; a message says why that failed."""
        context = simulator.get_mutable_context()
        while True:
            try:
                status = simulator.AdvanceTo(end)
            except RuntimeError as error:
                return self._read(context, turned), str(error).splitlines()[0]
            state = self._read(context, turned)
            if not (np.isfinite(state.q).all() and np.isfinite(state.v).all()):
                return state, "undefined numbers"
            if status.reason() == SimulatorStatus.ReturnReason.kReachedBoundaryTime:
                return state, ""
            state = recentred(self._tree, state)
            turned = state.turned
            self._put(context, context.get_time(), state)

    def _too_steep(self, context: Context) -> EventStatus:
        q = self._tree.plant.GetPositions(self._tree.plant.GetMyContextFromRoot(context))
        if np.abs(q[self._pitches]).max() < _STEEP:
            return EventStatus.DidNothing()
        return EventStatus.ReachedTermination(self._diagram, "a ball joint is steep")


def _settings(effort: Effort, times: Real) -> SimulatorConfig:
    """Drake's accuracy bounds the error of a step absolutely; a step may be as long as the run, or is the effort's."""
    controlled = effort.kind == "tolerance"
    return SimulatorConfig(
        integration_scheme=effort.method,
        use_error_control=controlled,
        accuracy=effort.value if controlled else 1e-4,  # unused without error control, but must be in (0, 1)
        max_step_size=times[-1] - times[0] if controlled else effort.value,
    )
