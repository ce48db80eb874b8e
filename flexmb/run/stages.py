"""A manoeuvre in stages: consecutive runs, each of which starts where the last one ended, with its own scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Unpack

from flexmb.integrate.integrator import Method
from flexmb.integrate.settings import Settings
from flexmb.run.origin import Given, start_time
from flexmb.run.simulate import RunPart, RunSettings, refuse_unknown, run_stages
from flexmb.run.times import refuse_large_run, sample_times
from flexmb.run.trajectory import Trajectory
from flexmb.scene.check import check_and_warn, check_run
from flexmb.scene.schema import Scene
from flexmb.system.algorithm import Algorithm
from flexmb.system.compile import assembled
from flexmb.system.system import System
from flexmb.tables import arguments
from flexmb.tables.named import brief
from flexmb.typing import Real


@dataclass(frozen=True)
class RunStage:
    """The duration (s) of a stage, and its differences from the stage before: another scene, other values, or none.

    values: see `Scene.with_values`; they remain in the stages that follow. samples: number of output times, both ends
    included.
    """

    duration_s: float
    values: Mapping[str, Any] = field(default_factory=dict)
    scene: Scene | None = None
    samples: int = 201

    __repr__ = brief


def simulate_stages(
    scene: Scene,
    stages: Sequence[RunStage],
    method: Method = "dop853",
    *,
    t_start: float | None = None,
    state: Given = None,
    algorithm: Algorithm = "articulated",
    stabilise: float = 0.0,
    **settings: Unpack[RunSettings],
) -> Trajectory:
    """Simulate stages in sequence and return one trajectory, which ends with the first stage that fails.

    Time continues from stage to stage, also for functions of time. Each stage starts with the coordinates and speeds at
    the end of the last one: scenes must have the same ones, and the same markers and hinges. Controllers are
    initialised in each stage. A motion that is prescribed in a stage must start with the value and rate that the
    coordinate then has, otherwise ValueError is raised.
    All other arguments: see `simulate`. Raises what `simulate` raises, before anything runs for an invalid scene,
    settings or output times of any stage, and ValueError for stages that do not fit each other.
    """
    refuse_unknown("simulate_stages", settings)
    scenes = _scenes(scene, stages)
    t, times = start_time(t_start, state), list[Real]()
    for i, (stage, scene_of_stage) in enumerate(zip(stages, scenes, strict=True)):
        start, t = t, t + stage.duration_s
        if i and scene_of_stage is scenes[i - 1]:
            check_run(scene_of_stage, t, start)
        else:
            check_and_warn(scene_of_stage, t, start)
        times.append(sample_times(stage.samples, t, start))
    chosen = Settings(method, **settings).checked(max(abs(times[0][0]), abs(t)))
    for scene_of_stage, own in zip(scenes, times, strict=True):
        refuse_large_run(scene_of_stage, len(own), chosen, algorithm)
    parts = [RunPart(system, own) for system, own in zip(_systems(scenes), times, strict=True)]
    return run_stages(parts, state, chosen, algorithm, stabilise)


def _scenes(scene: Scene, stages: Sequence[RunStage]) -> list[Scene]:
    """The scenes of all stages; one that does not change is the same object. ValueError for a duration that is none."""
    if not stages:
        raise ValueError("there are no stages: give at least one")
    scenes: list[Scene] = []
    for i, stage in enumerate(stages):
        if arguments.number(f"stages[{i}].duration_s", stage.duration_s) <= 0.0:
            raise ValueError(f"stages[{i}] lasts {stage.duration_s:g} s: give a positive duration")
        if scenes and scenes[-1].events:
            raise NotImplementedError(
                f"stages[{i - 1}] has events, which change its scene: use events on time in place of later stages"
            )
        scene = (stage.scene or scene).with_values(stage.values)
        scenes.append(scenes[-1] if scenes and scenes[-1] == scene else scene)
    return scenes


def _systems(scenes: Sequence[Scene]) -> list[System]:
    """The systems of checked scenes, each built once; ValueError if they do not fit each other."""
    systems: list[System] = []
    for i, scene in enumerate(scenes):
        systems.append(systems[-1] if i and scene is scenes[i - 1] else assembled(scene))
        for what, names in (("coordinates", 0), ("speeds", 1)):
            strange = set(systems[i].state_names[names]) ^ set(systems[0].state_names[names])
            if strange:
                listed = ", ".join(sorted(name for name, _ in strange))
                raise ValueError(f"stages[{i}] has other {what} than stages[0]: {listed}")
    return systems
