"""A scene with events or controllers, compiled for a peer."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np

from crosscheck.engines.contract import Effort, Run, Snapshot, Trajectory
from crosscheck.engines.hybrid.loop import HybridMotion
from crosscheck.engines.hybrid.phase import Compile, PhaseSample
from crosscheck.engines.hybrid.reading import coordinate_names
from crosscheck.engines.hybrid.stepping import Stopped
from crosscheck.engines.trajectories import stack
from flexmb.scene.schema import Latch, Release, Scene


@dataclass(frozen=True)
class HybridModel:
    """A scene with events or controllers, compiled for a peer; `works`: whether its mechanics integrates the work."""

    scene: Scene
    compiled: Compile
    works: bool = True

    def warm_up(self) -> None:
        """Nothing is compiled; touch the code once so that first-call costs are not timed."""
        self.evaluate()

    def evaluate(self) -> Snapshot:
        motion = HybridMotion(self.scene, self.compiled, np.zeros(2), Effort("tolerance", 1e-6, "DOP853"))
        motion.begin()
        return self._observed(motion.sample(0.0))

    def simulate(self, run: Run, effort: Effort) -> Trajectory:
        start = time.perf_counter()
        message = ""
        with np.errstate(over="ignore", invalid="ignore"):  # divergence is a status
            motion = HybridMotion(self.scene, self.compiled, run.times, effort)
            try:
                motion.run()
            except Stopped as stopped:
                message = str(stopped)
        wall = time.perf_counter() - start
        samples = [self._observed(sample) for sample in motion.samples]
        work = np.array([sample.y[-1] for sample in motion.samples]) if self.works else None
        done = stack(
            run.times, samples, message=message, wall_s=wall, evaluations=motion.evaluations, steps=motion.steps,
            work=work,
        )  # fmt: skip
        return replace(done, events=tuple(motion.happened))

    def _observed(self, sample: PhaseSample) -> Snapshot:
        """With drive loads of zero where a coordinate is free that events hold at other times."""
        phase, t, y, outputs = sample
        phase.outputs.now = outputs
        seen = phase.mechanics.observe(t, phase.mechanics.state(t, y))
        return replace(seen, drives={name: np.zeros(1) for name in held_by_events(self.scene)} | seen.drives)


def held_by_events(scene: Scene) -> list[str]:
    """The hinges, wheels and point masses whose coordinates events latch or release."""
    names = coordinate_names(scene)
    actions = [action for event in scene.events for action in event.actions]
    return [names[action.coordinate][0] for action in actions if isinstance(action, Latch | Release)]
