"""The native adapter: flexmb itself behind the engine contract. Conventions already agree; nothing is converted."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

import numpy as np

from crosscheck.engines.contract import Effort, MarkerPath, MarkerSnapshot, Run, Snapshot, Status, Support, Trajectory
from flexmb.scene.check import SceneError
from flexmb.scene.schema import Scene
from flexmb.simulation import simulate
from flexmb.system import System, compile
from flexmb.trajectory import Trajectory as NativeTrajectory

_TOLERANCES = (1e-6, 1e-8, 1e-10, 1e-12)
_ABSOLUTE = 1e-2  # atol over rtol: modal coordinates and small rates are of the order of hundredths


class NativeEngine:
    """flexmb at the levels the scene asks for, with DOP853."""

    name = "native"

    def version(self) -> str:
        try:
            return version("flexmb")
        except PackageNotFoundError:  # a source tree that is on the path but not installed
            return "source"

    def supports(self, scene: Scene) -> Support:
        try:
            compile(scene)
        except (SceneError, NotImplementedError) as error:
            return Support("no", str(error))
        return Support("exact")

    def efforts(self, scene: Scene) -> tuple[Effort, ...]:
        """A ladder of tolerances; DOP853 finds the steps that fit the scene."""
        return tuple(Effort("tolerance", value, "dop853") for value in _TOLERANCES)

    def compile(self, scene: Scene) -> NativeModel:
        return NativeModel(compile(scene))


class NativeModel:
    """A compiled system."""

    def __init__(self, system: System) -> None:
        self._system = system

    def warm_up(self) -> None:
        """Compile or load what a run needs: the integrator, by a run over next to no time, and the outputs."""
        self.simulate(Run(np.array([0.0, 1e-6])), Effort("tolerance", 1e-3, "dop853"))

    def evaluate(self) -> Snapshot:
        state = self._system.initial_state
        seen = self._system.evaluate(0.0, state.q, state.u)
        return Snapshot(
            markers={
                name: MarkerSnapshot(m.position, m.quaternion, m.velocity, m.acceleration)
                for name, m in seen.markers.items()
            },
            loads=seen.loads,
            wheel_loads=seen.wheel_loads,
            drives=seen.drives,
            energy=seen.energy,
            momentum=seen.momentum,
        )

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        """A tolerance drives DOP853 (atol a hundredth of rtol), a step RK4."""
        t_end = float(run.times[-1])
        if effort.kind == "tolerance":
            done = simulate(
                self._system, t_end, "dop853", rtol=effort.value, atol=_ABSOLUTE * effort.value, samples=run.times
            )
        else:
            done = simulate(self._system, t_end, "rk4", step=effort.value, samples=run.times)
        return Trajectory(
            status=_status(done),
            message="" if done.finished else done.message,
            times=done.t,
            markers={
                name: MarkerPath(path.position, path.quaternion, path.velocity) for name, path in done.markers.items()
            },
            loads=done.loads,
            wheel_loads=done.wheel_loads,
            drives=done.drives,
            energy=done.energy,
            momentum=done.momentum,
            work=done.work,
            wall_s=done.statistics.run_s,
            evaluations=done.statistics.evaluations,
        )


def _status(done: NativeTrajectory) -> Status:
    """A run that never left its initial state has failed; one that left it has diverged."""
    if done.finished:
        return "finished"
    return "diverged" if done.stopped_at > 0.0 else "failed"
