"""A scene compiled for Kratos, and its runs."""

from __future__ import annotations

from time import perf_counter

import numpy as np

from crosscheck.engines.contract import Effort, MarkerSnapshot, Run, Snapshot, Trajectory
from crosscheck.engines.conventions import cross, quaternion_of, shift_wrench
from crosscheck.engines.kratos.efforts import meshed
from crosscheck.engines.kratos.layout import BeamLayout, layout
from crosscheck.engines.kratos.mesh import Mesh
from crosscheck.engines.kratos.solve import ImplicitSteps
from crosscheck.engines.kratos.state import MeshState
from crosscheck.engines.steps import steps_between_samples
from crosscheck.engines.trajectories import stack
from flexmb.scene.schema import Marker, Scene


class KratosModel:
    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def warm_up(self) -> None:
        """Import Kratos; nothing is compiled."""
        Mesh(layout(self.scene))

    def evaluate(self) -> Snapshot:
        """Accelerations by Kratos' mass matrices and forces, loads from these, with the scene's number of elements."""
        mesh = Mesh(layout(self.scene))
        return _snapshot(mesh.layout, ImplicitSteps(mesh, 1.0).state())

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        """Kratos' own steps, a power of two of them between samples. ValueError unless these are uniform in time."""
        mesh = Mesh(layout(meshed(self.scene, float(run.times[-1]), effort)))
        count = steps_between_samples(run.times, effort.value)
        begin = perf_counter()
        steps = ImplicitSteps(mesh, float(run.times[1] - run.times[0]) / count)
        states, work, message = [steps.state()], [0.0], ""
        while len(states) < len(run.times):
            if not all(steps.go_on() for _ in range(count)):
                message = f"{effort.label}: no solution at t = {steps.t:g} s of {run.times[-1]:g} s"
                break
            states.append(steps.state())
            work.append(steps.work)
        wall = perf_counter() - begin
        # The load at the start depends on the mesh: it is that of the scene's own at every effort, as in `evaluate`.
        samples = [self.evaluate(), *(_snapshot(mesh.layout, state) for state in states[1:])]
        return stack(
            run.times, samples, message=message, wall_s=wall, evaluations=steps.iterations, steps=steps.count,
            work=np.array(work),
        )


def _snapshot(layout: BeamLayout, state: MeshState) -> Snapshot:
    """The outputs of a state, in World axes."""
    world = layout.world
    hinge = layout.scene.hinges[0]
    force, torque = world.rotation @ state.held[:3], world.rotation @ state.held[3:]
    linear, angular = world.rotation @ state.momentum[:3], world.rotation @ state.momentum[3:]
    return Snapshot(
        markers={marker.name: _marker(layout, state, marker) for marker in layout.scene.markers},
        loads={hinge.name: np.concatenate([torque, force])},
        wheel_loads={},
        drives={hinge.name: state.held[5:]} if layout.prescribed else {},
        energy={"kinetic": state.kinetic, "strain": state.strain, "gravity": state.gravity},
        momentum=shift_wrench(np.concatenate([angular, linear]), world.position),
    )


def _marker(layout: BeamLayout, state: MeshState, marker: Marker) -> MarkerSnapshot:
    node = layout.node_at(marker.node)
    rotation = layout.world.rotation @ state.rotation[node] @ layout.rest(marker.node)
    arm = rotation @ np.array(marker.offset_m)
    linear, spin, acceleration, turning = (
        layout.world.rotation @ each[node, part]
        for each in (state.rate, state.acceleration)
        for part in (slice(0, 3), slice(3, 6))
    )
    position = layout.world.position + layout.world.rotation @ state.position[node] + arm
    classical = acceleration + cross(turning, arm) + cross(spin, cross(spin, arm))
    return MarkerSnapshot(
        position, quaternion_of(rotation), np.concatenate([spin, linear + cross(spin, arm)]),
        np.concatenate([turning, classical]),
    )  # fmt: skip
